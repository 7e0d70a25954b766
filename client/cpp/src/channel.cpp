#include "channel.h"

#include <grpcpp/create_channel.h>
#include <sys/un.h>

#include <charconv>

#include "credentials.h"

namespace marble::client {
namespace {

constexpr int kNoLimit = -1;
constexpr int kKeepalive_ms = 30'000;         // a server that is gone without a word is noticed in
constexpr int kKeepaliveTimeout_ms = 15'000;  // the sum of the two
// A server that was restarted is found again within the second of the two, not within gRPC's two minutes.
constexpr int kFirstBackoff_ms = 200;
constexpr int kLongestBackoff_ms = 2'000;
constexpr std::string_view kUnixPrefix = "unix:";

Error bad_address(const std::string& address, const char* rule) {
  return {ErrorCode::invalid_argument, "address", -1, "\"" + address + "\"", rule};
}

bool ends_in_port(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0) return false;
  const char* const end = address.data() + address.size();
  int port = 0;
  const auto [stop, error] = std::from_chars(address.data() + colon + 1, end, port);
  return error == std::errc() && stop == end && port >= 1 && port <= 65535;
}

}  // namespace

Expected<void> check_address(const std::string& address) {
  if (address.rfind(kUnixPrefix, 0) == 0) {
    const std::size_t length = address.size() - kUnixPrefix.size();
    if (length > 0 && length < sizeof(sockaddr_un::sun_path)) return {};
    return unexpected(bad_address(address, "must have a path of 1 to 107 bytes after unix:"));
  }
  if (ends_in_port(address)) return {};
  return unexpected(bad_address(address, "must be host:port, port in [1, 65535], or unix:PATH"));
}

Expected<std::shared_ptr<grpc::Channel>> open_channel(const std::string& address,
                                                      const ConnectOptions& options) {
  const auto credentials = make_credentials(options);
  if (!credentials) return unexpected(credentials.error());
  grpc::ChannelArguments arguments;
  if (!options.tls_server_name.empty()) arguments.SetSslTargetNameOverride(options.tls_server_name);
  // The server has its limit; the client must not be the one that cannot read an answer.
  arguments.SetMaxReceiveMessageSize(kNoLimit);
  arguments.SetMaxSendMessageSize(kNoLimit);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepalive_ms);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeout_ms);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);  // as many as a long solve takes
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kFirstBackoff_ms);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kLongestBackoff_ms);
  if (options.own_connection) arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  // http_proxy is set for browsers; a solver on loopback or in the same rack is not behind it.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  return grpc::CreateCustomChannel(address, *credentials, arguments);
}

}  // namespace marble::client
