#include "access/tls.h"

#include <grpc/grpc.h>
#include <grpc/grpc_security.h>

#include <string>
#include <vector>

#include "access/certificate_keeper.h"
#include "mutex.h"

namespace marble::server {
namespace {

/// The certificates of one address.
class Source {
 public:
  Source(const Settings& settings, const Log& log, const std::string& address)
      : keeper_(settings, log, address) {}

  /// gRPC's callback before a handshake.
  static grpc_ssl_certificate_config_reload_status fetch(void* source,
                                                         grpc_ssl_server_certificate_config** config) {
    return static_cast<Source*>(source)->next(config);
  }

 private:
  grpc_ssl_certificate_config_reload_status next(grpc_ssl_server_certificate_config** config)
      ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    const auto now = keeper_.look();
    if (now == served_) return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED;
    served_ = now;
    const grpc_ssl_pem_key_cert_pair pair = {now->key.c_str(), now->certificate.c_str()};
    // gRPC requires authorities of clients even if it requests no client certificate.
    const std::string& roots = now->client_ca.empty() ? now->certificate : now->client_ca;
    *config = grpc_ssl_server_certificate_config_create(roots.c_str(), &pair, 1);
    return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_NEW;
  }

  CertificateKeeper keeper_;
  Mutex mutex_;
  std::shared_ptr<const Certificates> served_ ABSL_GUARDED_BY(mutex_);
};

grpc_ssl_client_certificate_request_type request_type(const Settings& settings) {
  switch (client_certificate_of(settings)) {
    case ClientCertificate::require:
      return GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY;
    case ClientCertificate::request:
      return GRPC_SSL_REQUEST_CLIENT_CERTIFICATE_AND_VERIFY;
    case ClientCertificate::none:
      break;
  }
  return GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE;
}

/// grpc::experimental's file watcher would serve any contents of the files, even a key of another
/// certificate: this uses the core's fetcher, which keeps what it had.
class TlsCredentials final : public grpc::ServerCredentials {
 public:
  TlsCredentials(const Settings& settings, const Log& log) : settings_(settings), log_(log) {}

  void SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>&) override {}

 private:
  int AddPortToServer(const std::string& address, grpc_server* server) override {
    // One source per address: gRPC asks for the first certificates of each.
    sources_.push_back(std::make_unique<Source>(settings_, log_, address));
    grpc_server_credentials* credentials = grpc_ssl_server_credentials_create_with_options(
        grpc_ssl_server_credentials_create_options_using_config_fetcher(
            request_type(settings_), Source::fetch, sources_.back().get()));
    const int port = grpc_server_add_http2_port(server, address.c_str(), credentials);
    grpc_server_credentials_release(credentials);
    return port;
  }

  const Settings& settings_;
  const Log& log_;
  std::vector<std::unique_ptr<Source>> sources_;
};

}  // namespace

std::shared_ptr<grpc::ServerCredentials> tls_credentials(const Settings& settings, const Log& log) {
  return std::make_shared<TlsCredentials>(settings, log);
}

}  // namespace marble::server
