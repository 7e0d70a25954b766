#include "net/connection_calls.h"

#include <grpcpp/server_context.h>
#include <grpcpp/support/byte_buffer.h>

#include <cstring>

namespace marble::server {
namespace {

using grpc::experimental::InterceptionHookPoints;

// True if a method's messages arrive as bytes; see solver_service.h, jobs_service.h.
bool is_raw(const char* method) {
  for (const char* service : {"/marble.v1.Solver/", "/marble.v1.Jobs/"}) {
    if (std::strncmp(method, service, std::strlen(service)) == 0) return true;
  }
  return false;
}

bool is_own(const char* method) {
  constexpr char kPackage[] = "/marble.v1.";
  return std::strncmp(method, kPackage, std::strlen(kPackage)) == 0;
}

class ConnectionCall final : public grpc::experimental::Interceptor {
 public:
  ConnectionCall(std::shared_ptr<Connection> connection, const char* method)
      : connection_(std::move(connection)), raw_(is_raw(method)), own_(is_own(method)) {
    connection_->call_began(own_);
  }
  ~ConnectionCall() override { connection_->call_ended(own_); }
  ConnectionCall(const ConnectionCall&) = delete;
  ConnectionCall& operator=(const ConnectionCall&) = delete;

  void Intercept(grpc::experimental::InterceptorBatchMethods* batch) override {
    if (batch->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_MESSAGE)) {
      const auto* bytes = raw_ ? static_cast<const grpc::ByteBuffer*>(batch->GetRecvMessage()) : nullptr;
      connection_->message(bytes == nullptr ? 0 : static_cast<std::int64_t>(bytes->Length()));
    }
    if (batch->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_MESSAGE)) connection_->message(0);
    batch->Proceed();
  }

 private:
  const std::shared_ptr<Connection> connection_;
  const bool raw_, own_;
};

class ConnectionCalls final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit ConnectionCalls(ConnectionTable& connections) : connections_(connections) {}

  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* info) override {
    auto connection = connections_.find(info->server_context()->peer());
    if (connection == nullptr) return nullptr;                         // a unix socket
    return new ConnectionCall(std::move(connection), info->method());  // gRPC deletes it
  }

 private:
  ConnectionTable& connections_;
};

}  // namespace

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> connection_calls(
    ConnectionTable& connections) {
  return std::make_unique<ConnectionCalls>(connections);
}

}  // namespace marble::server
