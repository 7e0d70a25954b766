// httplib's server with connections of our own: bounded requests, certificates that can be renewed, a quick
// end.
#pragma once

#include <httplib.h>

#include <atomic>
#include <memory>

#include "http/tls_session.h"

namespace marble::server::http {

class BoundedServer final : public httplib::Server {
 public:
  /// `tls` is null in the clear.
  explicit BoundedServer(std::unique_ptr<TlsSessions> tls) : tls_(std::move(tls)) {}

  /// Before stop(): nobody is waited for any more.
  void hurry() { stopping_ = true; }

 private:
  bool process_and_close_socket(socket_t socket) override;

  const std::unique_ptr<TlsSessions> tls_;
  std::atomic<bool> stopping_ = false;
};

}  // namespace marble::server::http
