// TLS for the connections of the HTTP port.
#pragma once

#include <openssl/ssl.h>

#include <memory>
#include <optional>
#include <string>

#include "access/certificate_keeper.h"

namespace marble::server::http {

struct SslFree {
  void operator()(SSL* session) const { SSL_free(session); }
};
using TlsSession = std::unique_ptr<SSL, SslFree>;

/// Thread-safe. Both references must outlive it.
class TlsSessions {
 public:
  TlsSessions(const Settings& settings, const Log& log, const std::string& address)
      : client_(client_certificate_of(settings)), keeper_(settings, log, address) {}

  /// Starts one handshake with the current certificates; null if OpenSSL has no memory.
  [[nodiscard]] TlsSession begin(int socket) ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  const ClientCertificate client_;
  CertificateKeeper keeper_;
  Mutex mutex_;
  std::shared_ptr<const Certificates> served_ ABSL_GUARDED_BY(mutex_);
  std::shared_ptr<SSL_CTX> context_ ABSL_GUARDED_BY(mutex_);
};

/// Returns the client's name in its verified certificate: the first DNS name, else the first URI, else the
/// common name.
[[nodiscard]] std::optional<std::string> certificate_name(const SSL* session);

}  // namespace marble::server::http
