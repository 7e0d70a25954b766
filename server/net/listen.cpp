#include "net/listen.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>

#include <algorithm>
#include <limits>
#include <thread>

#include "access/tls.h"
#include "base/process.h"
#include "grpc/health/v1/health.pb.h"
#include "metrics/rpc_metrics.h"
#include "net/connection_calls.h"

namespace marble::server {
namespace {

constexpr std::chrono::milliseconds kAddressPeriod{20};
constexpr double kStartGraceS = 2.0;
constexpr std::int64_t kOtherDescriptors = 32;
constexpr std::int64_t kFewestConnections = 4;

int milliseconds(double seconds) {
  return static_cast<int>(std::min(1000.0 * seconds, double{std::numeric_limits<int>::max()}));
}

// Bounds what a client may use of gRPC before the server sees its calls.
void set_bounds(grpc::ServerBuilder& builder, const Config& config) {
  // The limit on a message is checked after it is inflated: 10 MB of gzip would become 10 GB.
  for (const auto algorithm : {GRPC_COMPRESS_DEFLATE, GRPC_COMPRESS_GZIP})
    builder.SetCompressionAlgorithmSupportStatus(algorithm, false);
  builder.SetResourceQuota(
      grpc::ResourceQuota("marble").Resize(static_cast<std::size_t>(config.transport_bytes)));
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, config.connection_streams);
  builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, config.metadata_bytes);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, milliseconds(config.connection_idle_s));
  // Connections without any data are closed earlier, and counted, by the table of connections.
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS,
                             milliseconds(config.connection_start_s + kStartGraceS));
}

void set_limits(grpc::ServerBuilder& builder, const Config& config) {
  builder.SetMaxReceiveMessageSize(static_cast<int>(config.message_bytes));
  builder.SetMaxSendMessageSize(static_cast<int>(config.message_bytes));
  const int keepalive_ms = milliseconds(config.keepalive_s);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, keepalive_ms);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, keepalive_ms / 2);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);  // unlimited
  // Clients may ping as often as the server does.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, keepalive_ms / 2);
}

// A server that is shutting down frees its address in a moment.
Expected<ListeningSocket> open_in_time(const std::string& address, const Config& config, const Log& log) {
  const std::chrono::milliseconds silence(milliseconds(config.keepalive_s) / 2);
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                      std::chrono::duration<double>(config.listen_wait_s));
  bool reported = false;
  while (true) {
    auto socket = ListeningSocket::open(address, silence);
    if (socket || socket.error().bound != ListeningSocket::kInUse || Clock::now() >= end) return socket;
    if (!reported) {
      log.info(Component::server, "address_in_use",
               {{"address", address}, {"waits_s", config.listen_wait_s}});
    }
    reported = true;
    std::this_thread::sleep_for(kAddressPeriod);
  }
}

// gRPC's server and the sockets, both of the same addresses.
using Server = grpc::experimental::ExternalConnectionAcceptor;

std::shared_ptr<Server> served_with(grpc::ServerBuilder& builder,
                                    const std::shared_ptr<grpc::ServerCredentials>& credentials) {
  return builder.experimental().AddExternalConnectionAcceptor(
      grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD, credentials);
}

}  // namespace

ConnectionLimits connection_limits(const Config& config) {
  const auto duration = [](double seconds) {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  };
  // Each connection takes two descriptors, gRPC's and the table's; the HTTP port and everything else need
  // some too.
  const std::int64_t descriptors = raise_descriptor_limit() - kOtherDescriptors;
  const std::int64_t left = descriptors - std::min<std::int64_t>(config.http_connections, descriptors / 4);
  const std::int64_t all = std::clamp<std::int64_t>(left / 2, kFewestConnections, config.connections);
  return {.all = static_cast<int>(all),
          .host = config.host_connections,
          .unauthenticated_bytes = config.unauthenticated_bytes,
          .all_unauthenticated_bytes = config.transport_bytes / 4,
          .message_bytes = config.message_bytes,
          .start = duration(config.connection_start_s),
          .idle = duration(config.connection_idle_s)};
}

Expected<Listening> listen(const Config& config, const std::vector<grpc::Service*>& services, const Log& log,
                           Metrics& metrics, ConnectionTable& connections) {
  Listening result;
  std::vector<Acceptor::Entrance> entrances;
  for (const std::string& address : config.listen) {
    MARBLE_ASSIGN_OR_RETURN(auto socket, open_in_time(address, config, log));
    result.addresses.push_back(socket.address());
    entrances.push_back({std::move(socket), nullptr});
  }
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  // What reflection describes must be in the descriptor pool: gRPC's own health service is not.
  static_cast<void>(grpc::health::v1::HealthCheckRequest::descriptor());
  grpc::ServerBuilder builder;
  set_limits(builder, config);
  set_bounds(builder, config);
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> interceptors;
  if (metrics.on()) interceptors = rpc_interceptors(metrics.registry());
  interceptors.push_back(connection_calls(connections));
  builder.experimental().SetInterceptorCreators(std::move(interceptors));
  const auto in_the_clear = served_with(builder, grpc::InsecureServerCredentials());
  auto served = in_the_clear;
  if (!config.tls_certificate.empty()) {
    result.credentials = tls_credentials(config, log);
    served = served_with(builder, result.credentials);
  }
  for (std::size_t i = 0; i < entrances.size(); ++i)
    entrances[i].server = is_unix_address(config.listen[i]) ? in_the_clear : served;
  for (grpc::Service* service : services) builder.RegisterService(service);
  result.server = builder.BuildAndStart();
  if (result.server == nullptr)
    return unexpected(failure(ErrorCode::unavailable, "listen", "gRPC does not start"));
  set_serving(*result.server, true);
  result.acceptor = std::make_unique<Acceptor>(std::move(entrances), connections);
  return result;
}

void set_serving(const grpc::Server& server, bool serving) {
  grpc::HealthCheckServiceInterface* health = server.GetHealthCheckService();
  health->SetServingStatus(serving);
  for (const char* service : {"marble.v1.Solver", "marble.v1.Jobs", "marble.v1.Server"})
    health->SetServingStatus(service, serving);
}

}  // namespace marble::server
