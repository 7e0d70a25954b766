#include "config/certificates.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <ctime>
#include <memory>

#include "base/text_file.h"

namespace marble::server {
namespace {

template <auto Free>
struct Freed {
  template <class T>
  void operator()(T* object) const {
    Free(object);
  }
};
using Bio = std::unique_ptr<BIO, Freed<BIO_free>>;
using Certificate = std::unique_ptr<X509, Freed<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;

Bio bio_of(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

int no_password(char*, int, int, void*) { return -1; }  // never prompts on the terminal

Certificate first_certificate(const std::string& pem) {
  return Certificate(PEM_read_bio_X509(bio_of(pem).get(), nullptr, no_password, nullptr));
}

Key key_of(const std::string& pem) {
  return Key(PEM_read_bio_PrivateKey(bio_of(pem).get(), nullptr, no_password, nullptr));
}

/// True if it contains only certificates up to its end: readers would refuse an incomplete chain.
bool is_chain(const std::string& pem) {
  const Bio bio = bio_of(pem);
  int count = 0;
  while (const Certificate one{PEM_read_bio_X509(bio.get(), nullptr, no_password, nullptr)}) ++count;
  const bool at_end = ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE;
  ERR_clear_error();
  return count > 0 && at_end;
}

Expected<std::string> read(const char* setting, const std::string& path) {
  auto text = read_text_file(path);
  if (!text) return unexpected(of_field(setting, text.error()));
  return text;
}

Expected<std::string> read_chain(const char* setting, const std::string& path) {
  auto text = read(setting, path);
  if (text && !is_chain(*text))
    return unexpected(invalid(setting, path, "must hold certificates in PEM form"));
  return text;
}

}  // namespace

ClientCertificate client_certificate_of(const Settings& settings) {
  if (settings.tls_client == "require") return ClientCertificate::require;
  if (settings.tls_client == "request") return ClientCertificate::request;
  if (settings.tls_client == "none" || settings.tls_client_ca.empty()) return ClientCertificate::none;
  return ClientCertificate::require;
}

Expected<Certificates> read_certificates(const Settings& settings) {
  MARBLE_ASSIGN_OR_RETURN(auto certificate, read_chain("tls_certificate", settings.tls_certificate));
  MARBLE_ASSIGN_OR_RETURN(auto key_text, read("tls_key", settings.tls_key));
  const Key key = key_of(key_text);
  ERR_clear_error();
  if (key == nullptr)
    return unexpected(
        invalid("tls_key", settings.tls_key, "must hold a private key in PEM form, not encrypted"));
  const bool fits = X509_check_private_key(first_certificate(certificate).get(), key.get()) == 1;
  ERR_clear_error();
  if (!fits)
    return unexpected(invalid("tls_key", settings.tls_key, "must be the key of " + settings.tls_certificate));
  Certificates result{certificate, key_text, ""};
  if (client_certificate_of(settings) != ClientCertificate::none) {
    MARBLE_ASSIGN_OR_RETURN(result.client_ca, read_chain("tls_client_ca", settings.tls_client_ca));
  }
  return result;
}

std::vector<Error> faults_of_tls(const Settings& settings) {
  std::vector<Error> faults;
  const auto missing = [&](const char* setting, const char* rule) {
    faults.push_back(invalid(setting, rule));
  };
  const bool clients = client_certificate_of(settings) != ClientCertificate::none;
  if (settings.tls_certificate.empty() && !settings.tls_key.empty())
    missing("tls_key", "is of no use without tls_certificate");
  if (settings.tls_key.empty() && !settings.tls_certificate.empty())
    missing("tls_certificate", "is of no use without tls_key");
  if (settings.tls_certificate.empty() && clients)
    missing(settings.tls_client_ca.empty() ? "tls_client" : "tls_client_ca",
            "is of no use without tls_certificate");
  if (settings.tls_client_ca.empty() && clients) missing("tls_client", "needs tls_client_ca");
  if (!faults.empty() || settings.tls_certificate.empty()) return faults;
  if (const auto good = read_certificates(settings); !good) faults.push_back(good.error());
  return faults;
}

std::string expiry_of(const Certificates& certificates) {
  const Certificate certificate = first_certificate(certificates.certificate);
  std::tm time = {};
  if (certificate == nullptr || ASN1_TIME_to_tm(X509_get0_notAfter(certificate.get()), &time) != 1) return "";
  char text[32];
  const std::size_t length = std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &time);
  return {text, length};
}

bool is_expired(const Certificates& certificates) {
  const Certificate certificate = first_certificate(certificates.certificate);
  return certificate == nullptr || X509_cmp_current_time(X509_get0_notAfter(certificate.get())) <= 0 ||
         X509_cmp_current_time(X509_get0_notBefore(certificate.get())) >= 0;
}

}  // namespace marble::server
