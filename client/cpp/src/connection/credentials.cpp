#include "connection/credentials.h"

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace marble::client {
namespace {

Error bad_file(const char* field, const std::string& path, const std::string& why) {
  return invalid(field, path, why);
}

// Reads a PEM file and reports what gRPC would find only at the first handshake, as "unavailable".
Expected<std::string> read_pem(const char* field, const std::string& path) {
  if (path.empty()) return std::string();
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rbe"), &std::fclose);
  std::string content;
  char chunk[1 << 12];
  if (file != nullptr) {
    while (const std::size_t count = std::fread(chunk, 1, sizeof chunk, file.get()))
      content.append(chunk, count);
  }
  if (file == nullptr || std::ferror(file.get()) != 0)
    return unexpected(bad_file(field, path, std::string("cannot be read: ") + std::strerror(errno)));
  if (content.find("-----BEGIN ") == std::string::npos)
    return unexpected(bad_file(field, path, "must be a PEM file"));
  return content;
}

}  // namespace

bool wants_tls(const ConnectOptions& o) {
  return o.tls || !o.tls_ca.empty() || !o.tls_certificate.empty() || !o.tls_key.empty() ||
         !o.tls_server_name.empty();
}

Expected<std::shared_ptr<grpc::ChannelCredentials>> make_credentials(const ConnectOptions& options) {
  if (!wants_tls(options)) return grpc::InsecureChannelCredentials();
  if (options.tls_certificate.empty() != options.tls_key.empty()) {
    const char* missing = options.tls_key.empty() ? "tls_key" : "tls_certificate";
    return unexpected(bad_file(missing, "", "certificate and key must be given together"));
  }
  const auto ca = read_pem("tls_ca", options.tls_ca);
  if (!ca) return unexpected(ca.error());
  const auto certificate = read_pem("tls_certificate", options.tls_certificate);
  if (!certificate) return unexpected(certificate.error());
  const auto key = read_pem("tls_key", options.tls_key);
  if (!key) return unexpected(key.error());
  return grpc::SslCredentials({*ca, *key, *certificate});
}

}  // namespace marble::client
