#include "tls.h"

#include <grpc/grpc.h>
#include <grpc/grpc_security.h>

#include <string>
#include <vector>

#include "certificates.h"
#include "mutex.h"

namespace marble::server {
namespace {

/// The certificates of one address.
class Source {
 public:
  Source(const Settings& settings, const Log& log, std::string address)
      : settings_(settings), log_(log), address_(std::move(address)) {}

  /// gRPC's callback before a handshake.
  static grpc_ssl_certificate_config_reload_status fetch(void* source,
                                                         grpc_ssl_server_certificate_config** config) {
    return static_cast<Source*>(source)->next(config);
  }

 private:
  grpc_ssl_certificate_config_reload_status next(grpc_ssl_server_certificate_config** config)
      ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    const auto read = read_certificates(settings_);
    if (!read) {
      // Once, not at every handshake.
      const std::string fault = read.error().message();
      if (fault != last_fault_)
        log_.error(Component::tls, "certificate_refused", {{"address", address_}, {"reason", fault}});
      last_fault_ = fault;
      return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED;
    }
    last_fault_.clear();
    if (*read == in_force_) return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED;
    in_force_ = *read;
    if (is_expired(in_force_)) {
      log_.warn(Component::tls, "certificate_expired",
                {{"address", address_}, {"valid_until", expiry_of(in_force_)}});
    } else {
      log_.info(Component::tls, "certificate",
                {{"address", address_}, {"valid_until", expiry_of(in_force_)}});
    }
    const grpc_ssl_pem_key_cert_pair pair = {in_force_.key.c_str(), in_force_.certificate.c_str()};
    // gRPC insists on authorities of clients where it asks for no client's certificate too.
    const std::string& roots = in_force_.client_ca.empty() ? in_force_.certificate : in_force_.client_ca;
    *config = grpc_ssl_server_certificate_config_create(roots.c_str(), &pair, 1);
    return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_NEW;
  }

  const Settings& settings_;
  const Log& log_;
  const std::string address_;
  Mutex mutex_;
  Certificates in_force_ ABSL_GUARDED_BY(mutex_);
  std::string last_fault_ ABSL_GUARDED_BY(mutex_);
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

/// grpc::experimental's file watcher would serve whatever the files hold, a key of another certificate too:
/// this takes the core's fetcher, which keeps what it had.
class TlsCredentials final : public grpc::ServerCredentials {
 public:
  TlsCredentials(const Settings& settings, const Log& log) : settings_(settings), log_(log) {}

  void SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>&) override {}

 private:
  int AddPortToServer(const std::string& address, grpc_server* server) override {
    // A source an address: gRPC asks for the first certificates of each.
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
