#include "metrics/rpc_metrics.h"

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/status.h>

#include <array>
#include <chrono>
#include <string>
#include <unordered_map>

#include "marble/v1/service.pb.h"

namespace marble::server {
namespace {

using grpc::experimental::InterceptionHookPoints;

// In the order of grpc::StatusCode.
constexpr std::array kCodes = {
    "OK",        "CANCELLED",      "UNKNOWN",           "INVALID_ARGUMENT",   "DEADLINE_EXCEEDED",
    "NOT_FOUND", "ALREADY_EXISTS", "PERMISSION_DENIED", "RESOURCE_EXHAUSTED", "FAILED_PRECONDITION",
    "ABORTED",   "OUT_OF_RANGE",   "UNIMPLEMENTED",     "INTERNAL",           "UNAVAILABLE",
    "DATA_LOSS", "UNAUTHENTICATED"};
static_assert(kCodes.size() == static_cast<std::size_t>(grpc::StatusCode::UNAUTHENTICATED) + 1);

constexpr std::array kStandardMethods = {"grpc.health.v1.Health/Check", "grpc.health.v1.Health/Watch",
                                         "grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"};

// The series of one method.
struct MethodSeries {
  MethodSeries(MetricRegistry& registry, const std::string& method, bool is_raw)
      : raw(is_raw),
        open(registry.gauge(Metric::rpcs_open, {method})),
        seconds(registry.histogram(Metric::rpc_seconds, {method})),
        received_bytes(registry.counter(Metric::rpc_received_bytes, {method})),
        sent_bytes(registry.counter(Metric::rpc_sent_bytes, {method})) {
    for (std::size_t code = 0; code < kCodes.size(); ++code)
      ended[code] = &registry.counter(Metric::rpcs, {method, kCodes[code]});
  }

  const bool raw;  // of this server: its messages arrive as bytes, not parsed by gRPC
  std::array<prometheus::Counter*, kCodes.size()> ended = {};
  prometheus::Gauge& open;
  prometheus::Histogram& seconds;
  prometheus::Counter &received_bytes, &sent_bytes;
};

// Counts one call.
class RpcInterceptor final : public grpc::experimental::Interceptor {
 public:
  explicit RpcInterceptor(MethodSeries& series) : series_(series) { series_.open.Increment(); }
  ~RpcInterceptor() override { series_.open.Decrement(); }
  RpcInterceptor(const RpcInterceptor&) = delete;
  RpcInterceptor& operator=(const RpcInterceptor&) = delete;

  void Intercept(grpc::experimental::InterceptorBatchMethods* batch) override {
    if (series_.raw && batch->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_MESSAGE)) {
      const auto* bytes = static_cast<const grpc::ByteBuffer*>(batch->GetRecvMessage());
      if (bytes != nullptr) series_.received_bytes.Increment(static_cast<double>(bytes->Length()));
    }
    if (batch->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_MESSAGE)) {
      const grpc::ByteBuffer* bytes = batch->GetSerializedSendMessage();
      if (bytes != nullptr) series_.sent_bytes.Increment(static_cast<double>(bytes->Length()));
    }
    if (batch->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS)) {
      series_.ended[code_of(batch->GetSendStatus())]->Increment();
      series_.seconds.Observe(
          std::chrono::duration<double>(std::chrono::steady_clock::now() - begun_).count());
    }
    batch->Proceed();
  }

 private:
  // A handler may send any number.
  static std::size_t code_of(const grpc::Status& status) {
    const auto code = static_cast<std::size_t>(status.error_code());
    return code < kCodes.size() ? code : static_cast<std::size_t>(grpc::StatusCode::UNKNOWN);
  }

  MethodSeries& series_;
  const std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
};

// Knows the existing methods; any other that a client calls is "other".
class RpcInterceptors final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit RpcInterceptors(MetricRegistry& registry) : other_(registry, "other", false) {
    const google::protobuf::FileDescriptor* file = v1::GetInfoRequest::descriptor()->file();
    for (int i = 0; i < file->service_count(); ++i) {
      const google::protobuf::ServiceDescriptor* service = file->service(i);
      for (int j = 0; j < service->method_count(); ++j)
        add(registry, service->full_name() + "/" + service->method(j)->name(), true);
    }
    for (const char* method : kStandardMethods) add(registry, method, false);
  }

  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* info) override {
    const auto known = methods_.find(info->method());
    return new RpcInterceptor(known == methods_.end() ? other_ : *known->second);  // gRPC deletes it
  }

 private:
  void add(MetricRegistry& registry, const std::string& method, bool raw) {
    methods_.emplace("/" + method, std::make_unique<MethodSeries>(registry, method, raw));
  }

  std::unordered_map<std::string, std::unique_ptr<MethodSeries>> methods_;  // key: gRPC's path
  MethodSeries other_;
};

}  // namespace

std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> rpc_interceptors(
    MetricRegistry& registry) {
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> creators;
  creators.push_back(std::make_unique<RpcInterceptors>(registry));
  return creators;
}

}  // namespace marble::server
