#include "listen.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>

#include "metrics/rpc_metrics.h"
#include "tls.h"

namespace marble::server {
namespace {

constexpr const char* kUnixPrefix = "unix:";

// gRPC replaces the socket's file whether somebody listens on it or not.
bool somebody_listens(const std::string& address) {
  if (address.rfind(kUnixPrefix, 0) != 0) return false;
  const std::string path = address.substr(std::strlen(kUnixPrefix));
  sockaddr_un name = {};
  name.sun_family = AF_UNIX;
  if (path.size() >= sizeof name.sun_path) return false;
  std::memcpy(name.sun_path, path.c_str(), path.size());
  const int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const bool connected = connect(probe, reinterpret_cast<const sockaddr*>(&name), sizeof name) == 0;
  close(probe);
  return connected;
}

void set_limits(grpc::ServerBuilder& builder, const Config& config) {
  builder.SetMaxReceiveMessageSize(static_cast<int>(config.message_bytes));
  builder.SetMaxSendMessageSize(static_cast<int>(config.message_bytes));
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT,
                             0);  // a second server on the port must fail, not share it
  const int keepalive_ms = static_cast<int>(1000.0 * config.keepalive_s);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, keepalive_ms);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, keepalive_ms / 2);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);  // as many as it takes
  // Clients may ping as often as the server does.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, keepalive_ms / 2);
}

}  // namespace

Expected<Listening> listen(const Config& config, const std::vector<grpc::Service*>& services, const Log& log,
                           Metrics& metrics) {
  const auto refused = [](const std::string& address) {
    return unexpected(Error{ErrorCode::unavailable, "listen", -1, address,
                            "cannot listen: in use, or no address of this machine"});
  };
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  set_limits(builder, config);
  if (metrics.on()) builder.experimental().SetInterceptorCreators(rpc_interceptors(metrics.registry()));
  const auto in_the_clear = grpc::InsecureServerCredentials();
  Listening result;
  result.credentials = config.tls_certificate.empty() ? in_the_clear : tls_credentials(config, log);
  std::vector<int> ports(config.listen.size(), 0);
  for (std::size_t i = 0; i < ports.size(); ++i) {
    if (somebody_listens(config.listen[i])) return refused(config.listen[i]);
    builder.AddListeningPort(
        config.listen[i], is_unix_address(config.listen[i]) ? in_the_clear : result.credentials, &ports[i]);
  }
  for (grpc::Service* service : services) builder.RegisterService(service);
  result.server = builder.BuildAndStart();
  for (std::size_t i = 0; i < ports.size(); ++i) {
    const std::string& address = config.listen[i];
    if (ports[i] == 0) return refused(address);
    const std::string host = address.substr(0, address.rfind(':') + 1);
    result.addresses.push_back(is_unix_address(address) ? address : host + std::to_string(ports[i]));
  }
  if (result.server == nullptr) return refused("");
  set_serving(*result.server, true);
  return result;
}

void set_serving(const grpc::Server& server, bool serving) {
  grpc::HealthCheckServiceInterface* health = server.GetHealthCheckService();
  health->SetServingStatus(serving);
  for (const char* service : {"marble.v1.Solver", "marble.v1.Jobs", "marble.v1.Server"})
    health->SetServingStatus(service, serving);
}

}  // namespace marble::server
