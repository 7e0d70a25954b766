// Quick unary calls: identify the caller, parse, handle and reply, all on gRPC's thread.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <memory>
#include <type_traits>

#include "base/origin.h"
#include "base/status.h"
#include "base/wire.h"
#include "service/admission.h"
#include "store/submissions.h"

namespace marble::server {

/// Identifies the caller of a method that every role may call.
[[nodiscard]] inline auto of_any_role(const ServiceParts& parts, const grpc::CallbackServerContext& context) {
  return [&](Origin& origin) { return identify(parts, context, origin); };
}

/// The reactor of such a call; owns itself until gRPC is done with it.
class QuickCall final : public grpc::ServerUnaryReactor {
 public:
  explicit QuickCall(LiveCalls& calls) : token_(calls) {}
  void OnDone() override { delete this; }

 private:
  const LiveCalls::Token token_;
};

/// `who` identifies the caller, and records it in the origin, or returns why it is refused, before any byte
/// of the request is read. `handle` takes the caller and the request and fills the response, or returns an
/// error; it may also return what the response then waits for (Expected<OnFinished>; an empty one means
/// nothing).
template <class Request, class Response, class Who, class Handle>
grpc::ServerUnaryReactor* answer(const ServiceParts& parts, grpc::CallbackServerContext* context,
                                 const grpc::ByteBuffer* request_bytes, grpc::ByteBuffer* response_bytes,
                                 const Who& who, const Handle& handle, double retry_delay_s = 0.0) {
  auto* const call = new QuickCall(parts.calls);
  Origin origin = origin_of(*context);
  const auto response = std::make_shared<Response>();
  const auto respond = [&]() -> Expected<OnFinished> {
    MARBLE_ASSIGN_OR_RETURN(const auto caller, who(origin));
    Request request;
    MARBLE_RETURN_IF_ERROR(parse(request_bytes, &request));
    auto handled = handle(caller, request, response.get(), origin);
    if (!handled) return unexpected(handled.error());
    if constexpr (std::is_same_v<decltype(handled), Expected<OnFinished>>) return handled;
    return OnFinished();
  };
  const Expected<OnFinished> responded = or_out_of_memory(
      respond, [] { return failure(ErrorCode::resource_exhausted, "the server is out of memory"); });
  const auto finish = [call, response, response_bytes, retry_delay_s](const Expected<void>& ended) {
    if (ended) *response_bytes = serialize(*response);
    call->Finish(ended ? grpc::Status::OK : to_status(ended.error(), retry_delay_s));
  };
  if (!responded) {
    finish(unexpected(responded.error()));
  } else if (*responded) {
    (*responded)(finish);
  } else {
    finish({});
  }
  return call;
}

}  // namespace marble::server
