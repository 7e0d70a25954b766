// The server's certificate, its key and the authorities of its clients: reads them, and checks them before
// use.
#pragma once

#include <string>
#include <vector>

#include "config/settings.h"
#include "marble/error.h"

namespace marble::server {

/// PEM texts.
struct Certificates {
  std::string certificate, key, client_ca;  ///< client_ca is empty if clients need no certificate
  [[nodiscard]] bool operator==(const Certificates&) const = default;
};

enum class ClientCertificate { none, request, require };

/// Returns the meaning of tls_client, with auto resolved.
[[nodiscard]] ClientCertificate client_certificate_of(const Settings& settings);

/// Reads the files that the tls_ settings name. Error fields are settings: a file cannot be read or parsed,
/// or the key does not match the certificate.
[[nodiscard]] Expected<Certificates> read_certificates(const Settings& settings);

/// Returns all errors in the tls_ settings and their files.
[[nodiscard]] std::vector<Error> faults_of_tls(const Settings& settings);

/// Returns the end of the certificate's validity, as "2027-01-31T12:00:00Z".
[[nodiscard]] std::string expiry_of(const Certificates& certificates);
/// True if it has ended, or has not begun.
[[nodiscard]] bool is_expired(const Certificates& certificates);

}  // namespace marble::server
