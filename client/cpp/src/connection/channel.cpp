#include "connection/channel.h"

#include <grpcpp/create_channel.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>

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
  MARBLE_ASSIGN_OR_RETURN(const auto ca, read_pem("tls_ca", options.tls_ca));
  MARBLE_ASSIGN_OR_RETURN(const auto certificate, read_pem("tls_certificate", options.tls_certificate));
  MARBLE_ASSIGN_OR_RETURN(const auto key, read_pem("tls_key", options.tls_key));
  return grpc::SslCredentials({ca, key, certificate});
}

namespace {

constexpr int kNoLimit = -1;
// A restarted server is found within the second constant, not within gRPC's two minutes.
constexpr int kFirstBackoff_ms = 200;
constexpr int kLongestBackoff_ms = 2'000;
constexpr int kRetryBuffer_bytes = 256 << 20;  // data that a call keeps for a retry

int milliseconds(std::chrono::duration<double> time) {
  return static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(time).count());
}

// Returns gRPC's service config as JSON. Calls that get UNAVAILABLE before any response are retried at most
// three times if a repetition has the same effect: solves are pure, reads change nothing, a submission is
// one job by its request id. Not retried: Delete, Cancel, sessions and batches, whose first message may have
// been processed; gRPC repeats them only if no server has seen the call. With `several` servers, calls rotate
// over those that report to be healthy.
std::string service_config(bool several) {
  nlohmann::json names = nlohmann::json::array();
  const auto add = [&](const char* service, std::initializer_list<const char*> methods) {
    for (const char* method : methods)
      names.push_back({{"service", std::string("marble.v1.") + service}, {"method", method}});
  };
  add("Solver", {"Solve", "SolveStream", "SolveScenarios", "SolveCoupled"});
  add("Jobs", {"Submit", "Result", "List", "Get", "Watch", "Bundle", "SubmitArray", "ArrayResults"});
  add("Server", {"GetInfo"});
  nlohmann::json config = {{"methodConfig",
                            {{{"name", names},
                              {"retryPolicy",
                               {{"maxAttempts", 4},
                                {"initialBackoff", "0.1s"},
                                {"maxBackoff", "1s"},
                                {"backoffMultiplier", 2},
                                {"retryableStatusCodes", {"UNAVAILABLE"}}}}}}}};
  if (several) {
    config["loadBalancingConfig"] = {{{"round_robin", nlohmann::json::object()}}};
    config["healthCheckConfig"] = {{"serviceName", "marble.v1.Solver"}};
  }
  return config.dump();
}

}  // namespace

Expected<std::shared_ptr<grpc::Channel>> open_channel(const Target& target, const ConnectOptions& options) {
  MARBLE_ASSIGN_OR_RETURN(const auto credentials, make_credentials(options));
  grpc::ChannelArguments arguments;
  const std::string& server_name =
      options.tls_server_name.empty() ? target.authority : options.tls_server_name;
  if (!server_name.empty()) arguments.SetString(GRPC_ARG_DEFAULT_AUTHORITY, server_name);
  if (!server_name.empty() && wants_tls(options)) arguments.SetSslTargetNameOverride(server_name);
  arguments.SetServiceConfigJSON(service_config(target.several));
  arguments.SetInt(GRPC_ARG_PER_RPC_RETRY_BUFFER_SIZE, kRetryBuffer_bytes);
  // The server has its limit; the client must not be the side that cannot read a response.
  arguments.SetMaxReceiveMessageSize(kNoLimit);
  arguments.SetMaxSendMessageSize(kNoLimit);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, milliseconds(options.keepalive.silence));
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, milliseconds(options.keepalive.answer));
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);  // as many as a long solve takes
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kFirstBackoff_ms);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kLongestBackoff_ms);
  if (!options.retries) arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
  if (options.own_connection) arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  // http_proxy is set for browsers; a solver on loopback or in the same rack is not behind it.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  return grpc::CreateCustomChannel(target.name, credentials, arguments);
}

}  // namespace marble::client
