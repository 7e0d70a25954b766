// What gRPC and protobuf have to say by themselves, such as of failed TLS handshakes or bytes that are no
// message, as lines of our log.
#pragma once

#include "log/log.h"

namespace marble::server {

/// Each has one log function a process, so there is one of these, made by main before they are used. Once it
/// is gone they write nothing: standard error may stall, and nobody is to wait for its reader.
class LibraryLog {
 public:
  explicit LibraryLog(const Log& log);
  ~LibraryLog();
  LibraryLog(const LibraryLog&) = delete;
  LibraryLog& operator=(const LibraryLog&) = delete;

  /// Has gRPC make the messages that the level of its component lets through.
  void follow_level() const;

 private:
  const Log& log_;
};

}  // namespace marble::server
