// Writes the messages of gRPC and protobuf, such as failed TLS handshakes or bytes that cannot be parsed, to
// the server's log.
#pragma once

#include "log/log.h"

namespace marble::server {

/// Each library has one log function per process, so there is one object of this class, made by main before
/// they are used. After its end they write nothing: standard error may stall, and no thread may wait for its
/// reader.
class LibraryLog {
 public:
  explicit LibraryLog(const Log& log);
  ~LibraryLog();
  LibraryLog(const LibraryLog&) = delete;
  LibraryLog& operator=(const LibraryLog&) = delete;

  /// Makes gRPC produce only messages that the level of its component allows.
  void follow_level() const;

 private:
  const Log& log_;
};

}  // namespace marble::server
