// Certificates for tests, made by the openssl command.
#pragma once

#include <string>
#include <vector>

#include "support/child_process.h"

namespace marble::testing {

/// PEM files of a certificate and its key.
struct CertificateFiles {
  std::string certificate, key;
};

/// A certificate authority of its own. Throws if openssl fails.
class TestAuthority {
 public:
  TestAuthority();

  [[nodiscard]] std::string certificate() const { return directory_.file("authority.pem"); }
  /// A new certificate of this authority with the common name and the subject's alternative names, such as
  /// "DNS:localhost,IP:127.0.0.1"; empty for none. `days` below 0 makes one that has expired.
  CertificateFiles issue(const std::string& common_name, const std::string& alternative_names, int days = 30);
  /// One that 127.0.0.1 and localhost may show.
  CertificateFiles issue_for_server(int days = 30) {
    return issue("server", "IP:127.0.0.1,DNS:localhost", days);
  }

 private:
  void openssl(std::vector<std::string> arguments);

  TemporaryDirectory directory_;
  int issued_ = 0;
};

}  // namespace marble::testing
