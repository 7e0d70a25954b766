// Waits for the result of a submitted job.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>

#include "service/service_parts.h"

namespace marble::server {

/// Owns itself until gRPC is done with it; the store that will call it back owns it too, until the result
/// exists.
class ResultCall final : public grpc::ServerUnaryReactor, public TimerListener {
 public:
  static grpc::ServerUnaryReactor* begin(const ServiceParts& parts, grpc::CallbackServerContext& context,
                                         const grpc::ByteBuffer* request, grpc::ByteBuffer* response);

  // From gRPC.
  void OnCancel() override;
  void OnDone() override;
  // From the timer: drain.
  void on_timer(Clock::time_point now) override;

 private:
  ResultCall(const ServiceParts& parts, grpc::ByteBuffer* response) : parts_(parts), response_(response) {}
  [[nodiscard]] Expected<void> wait(grpc::CallbackServerContext& context, const grpc::ByteBuffer* request);
  void answer(const ResultStore::Shared& result);
  void finish(const grpc::Status& status);

  const ServiceParts& parts_;
  grpc::ByteBuffer* const response_;
  std::string id_;
  std::atomic<bool> finished_ = false;
  std::shared_ptr<ResultCall> self_;
};

}  // namespace marble::server
