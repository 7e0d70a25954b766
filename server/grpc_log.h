// gRPC's own messages, such as those of failed TLS handshakes, as lines of our log.
#pragma once

#include "log.h"

namespace marble::server {

/// While it lives: gRPC has one log function a process, so there is one of these, made by main before gRPC is
/// used. Afterwards gRPC writes to standard error as it does by itself.
class GrpcLog {
 public:
  explicit GrpcLog(const Log& log);
  ~GrpcLog();
  GrpcLog(const GrpcLog&) = delete;
  GrpcLog& operator=(const GrpcLog&) = delete;

  /// Has gRPC make the messages that the level of its component lets through.
  void follow_level() const;

 private:
  const Log& log_;
};

}  // namespace marble::server
