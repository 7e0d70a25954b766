#include "http/tls_session.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

namespace marble::server::http {
namespace {

struct BioFree {
  void operator()(BIO* bio) const { BIO_free(bio); }
};
struct X509Free {
  void operator()(X509* certificate) const { X509_free(certificate); }
};
using Bio = std::unique_ptr<BIO, BioFree>;
using Certificate = std::unique_ptr<X509, X509Free>;

Bio bio_of(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

Certificate next_certificate(const Bio& bio) {
  return Certificate(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
}

void take_own(SSL_CTX* context, const Certificates& texts) {
  const Bio chain = bio_of(texts.certificate);
  if (const Certificate own = next_certificate(chain)) SSL_CTX_use_certificate(context, own.get());
  while (const Certificate one = next_certificate(chain)) SSL_CTX_add1_chain_cert(context, one.get());
  const Bio text = bio_of(texts.key);
  EVP_PKEY* key = PEM_read_bio_PrivateKey(text.get(), nullptr, nullptr, nullptr);
  SSL_CTX_use_PrivateKey(context, key);
  EVP_PKEY_free(key);
}

void take_clients(SSL_CTX* context, const Certificates& texts, ClientCertificate client) {
  if (client == ClientCertificate::none) return;
  const Bio authorities = bio_of(texts.client_ca);
  while (const Certificate one = next_certificate(authorities)) {
    X509_STORE_add_cert(SSL_CTX_get_cert_store(context), one.get());
    SSL_CTX_add_client_CA(context, one.get());
  }
  const int needs = client == ClientCertificate::require ? SSL_VERIFY_FAIL_IF_NO_PEER_CERT : 0;
  SSL_CTX_set_verify(context, SSL_VERIFY_PEER | needs, nullptr);
}

// The texts were checked when they were read.
std::shared_ptr<SSL_CTX> context_of(const Certificates& texts, ClientCertificate client) {
  std::shared_ptr<SSL_CTX> context(SSL_CTX_new(TLS_server_method()), SSL_CTX_free);
  if (context == nullptr) return nullptr;
  SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION);
  SSL_CTX_set_mode(context.get(), SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  // A resumed session would outlive a change of the authorities.
  SSL_CTX_set_session_cache_mode(context.get(), SSL_SESS_CACHE_OFF);
  SSL_CTX_set_options(context.get(), SSL_OP_NO_TICKET | SSL_OP_NO_RENEGOTIATION);
  take_own(context.get(), texts);
  take_clients(context.get(), texts, client);
  ERR_clear_error();
  return context;
}

std::string text_of(const ASN1_STRING* value) {
  return {reinterpret_cast<const char*>(ASN1_STRING_get0_data(value)),
          static_cast<std::size_t>(ASN1_STRING_length(value))};
}

std::string alternative_name(const X509* certificate, int type) {
  auto* names =
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr));
  std::string result;
  for (int i = 0; i < sk_GENERAL_NAME_num(names) && result.empty(); ++i) {
    const GENERAL_NAME* name = sk_GENERAL_NAME_value(names, i);
    if (name->type == type) result = text_of(name->d.ia5);
  }
  GENERAL_NAMES_free(names);
  return result;
}

std::string common_name(const X509* certificate) {
  const X509_NAME* subject = X509_get_subject_name(certificate);
  const int at = X509_NAME_get_index_by_NID(subject, NID_commonName, -1);
  return at < 0 ? "" : text_of(X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at)));
}

}  // namespace

TlsSession TlsSessions::begin(int socket) {
  const MutexLock lock(mutex_);
  const auto now = keeper_.look();
  if (now == nullptr) return nullptr;
  if (now != served_) context_ = context_of(*now, client_);
  served_ = now;
  TlsSession session(context_ == nullptr ? nullptr : SSL_new(context_.get()));
  if (session != nullptr) SSL_set_fd(session.get(), socket);
  return session;
}

std::optional<std::string> certificate_name(const SSL* session) {
  if (session == nullptr || SSL_get_verify_result(session) != X509_V_OK) return std::nullopt;
  const X509* certificate = SSL_get0_peer_certificate(session);
  if (certificate == nullptr) return std::nullopt;
  std::string name = alternative_name(certificate, GEN_DNS);
  if (name.empty()) name = alternative_name(certificate, GEN_URI);
  if (name.empty()) name = common_name(certificate);
  return name.empty() ? std::nullopt : std::optional(name);
}

}  // namespace marble::server::http
