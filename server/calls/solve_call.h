// The unary RPC that solves one problem.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include "base/origin.h"
#include "service/service_parts.h"

namespace marble::server {

/// Owns itself until gRPC is done with it; its job owns it too, until it has finished.
class SolveCall final : public grpc::ServerUnaryReactor, public JobObserver {
 public:
  /// Parses, checks and admits the request, or refuses it.
  static grpc::ServerUnaryReactor* begin(const ServiceParts& parts, grpc::CallbackServerContext& context,
                                         const grpc::ByteBuffer* request, grpc::ByteBuffer* response);

  // From gRPC.
  void OnCancel() override;
  void OnDone() override;
  // From the scheduler.
  void finished(Outcome outcome) override;

 private:
  SolveCall(const ServiceParts& parts, grpc::ByteBuffer* response) : parts_(parts), response_(response) {}
  [[nodiscard]] Expected<void> admit(const grpc::ByteBuffer* request,
                                     const grpc::CallbackServerContext& context, Origin& origin);

  const ServiceParts& parts_;
  grpc::ByteBuffer* const response_;
  std::shared_ptr<Job> job_;  // constant once admitted
  std::shared_ptr<SolveCall> self_;
};

}  // namespace marble::server
