// Methods with one message from the client, which is read only once the caller is identified. gRPC reads the
// message of a unary method before it shows the call, so unauthenticated clients could make it hold any
// number of large messages. These methods are therefore served as streams, which look the same on the wire.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>
#include <functional>
#include <utility>

#include "base/origin.h"
#include "base/status.h"
#include "marble/v1/service.grpc.pb.h"
#include "service/admission.h"
#include "service/service_parts.h"
#include "store/submissions.h"

namespace marble::server {

/// What is done with a request before its method begins, for any caller.
using ReadFirstLook = void (*)(const ServiceParts& parts, const grpc::ByteBuffer& request,
                               CompletionCallback then);

/// gRPC sees a stream; `Inner`, a reactor of a method with one message, starts with that message, or with
/// none if the caller is unknown: it refuses such a caller before anything else. Owns itself.
template <class Inner, class InnerCall>
class ReadFirst final : public grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>,
                        private LiveCalls::Unread {
 public:
  /// Calls `method` with the context, the request and the response; the method uses those it needs.
  template <class Method>
  static grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* begin(
      const ServiceParts& parts, grpc::CallbackServerContext* context, const Method& method,
      ReadFirstLook look) {
    auto* const call = new ReadFirst(parts, *context, look);
    call->method_ = [method, context, call] { return method(context, &call->request_, &call->response_); };
    if (parts.access.is_known(*context)) {
      parts.connections.known(context->peer());
      call->StartRead(&call->request_);  // before a refusal, after which gRPC may free the call
      if (!parts.calls.may_wait(*call)) call->refuse();
    } else {
      const grpc::Slice nothing;
      call->request_ = grpc::ByteBuffer(&nothing, 1);
      call->begin_inner();
    }
    return call;
  }

  void OnReadDone(bool ok) override {
    if (!parts_.calls.has_come(*this)) return;
    if (ok && look_ == nullptr) return begin_inner();
    if (ok) {
      ++until_done_;
      return look_(parts_, request_, [this](const Expected<void>& how) { this->begin_if(how); });
    }
    this->Finish(to_status(failure(ErrorCode::invalid_argument, "the request has no message")));
  }
  void OnWriteDone(bool ok) override { call_.write_done(inner_, ok); }
  void OnCancel() override { cancel_when_both(); }
  void OnDone() override { done(); }

 private:
  friend InnerCall;
  ReadFirst(const ServiceParts& parts, grpc::CallbackServerContext& context, ReadFirstLook look)
      : token_(parts.calls), parts_(parts), context_(context), look_(look), call_(*this) {}

  void refuse() override { this->Finish(refused(parts_, origin_of(context_), draining())); }
  // Runs on a thread that gRPC does not know: gRPC may free the call before this returns.
  void begin_if(const Expected<void>& looked) {
    if (looked) {
      begin_inner();
    } else {
      this->Finish(to_status(looked.error(), parts_.scheduler.retry_delay_s()));
    }
    done();
  }
  void begin_inner() {
    inner_ = method_();
    call_.bind(inner_);
    cancel_when_both();
  }
  // Cancels once the call has begun and its client has cancelled it, in either order.
  void cancel_when_both() {
    if (--until_cancel_ == 0) inner_->OnCancel();
  }

  void done() {
    if (--until_done_ > 0) return;
    if (inner_ != nullptr) inner_->OnDone();
    delete this;
  }

  const LiveCalls::Token token_;
  const ServiceParts& parts_;
  grpc::CallbackServerContext& context_;
  const ReadFirstLook look_;
  InnerCall call_;
  std::function<Inner*()> method_;
  Inner* inner_ = nullptr;
  std::atomic<int> until_cancel_ = 2;
  std::atomic<int> until_done_ = 1;
  grpc::ByteBuffer request_, response_;
};

/// Passed to the reactor of a unary method in place of gRPC's call.
class UnaryReadFirst final : public grpc::ServerCallbackUnary {
 public:
  using Outer = ReadFirst<grpc::ServerUnaryReactor, UnaryReadFirst>;
  explicit UnaryReadFirst(Outer& outer) : outer_(outer) {}

  void bind(grpc::ServerUnaryReactor* inner) { BindReactor(inner); }
  void write_done(grpc::ServerUnaryReactor*, bool) {}
  void Finish(grpc::Status status) override;
  void SendInitialMetadata() override;

 private:
  grpc::internal::ServerReactor* reactor() override { return nullptr; }
  void CallOnDone() override {}

  Outer& outer_;
};

/// Passed to the reactor of a server-streaming method in place of gRPC's call.
class StreamReadFirst final : public grpc::ServerCallbackWriter<grpc::ByteBuffer> {
 public:
  using Inner = grpc::ServerWriteReactor<grpc::ByteBuffer>;
  using Outer = ReadFirst<Inner, StreamReadFirst>;
  explicit StreamReadFirst(Outer& outer) : outer_(outer) {}

  void bind(Inner* inner) { BindReactor(inner); }
  void write_done(Inner* inner, bool ok) { inner->OnWriteDone(ok); }
  void Finish(grpc::Status status) override;
  void SendInitialMetadata() override;
  void Write(const grpc::ByteBuffer* message, grpc::WriteOptions options) override;
  void WriteAndFinish(const grpc::ByteBuffer* message, grpc::WriteOptions options,
                      grpc::Status status) override;

 private:
  grpc::internal::ServerReactor* reactor() override { return nullptr; }
  void CallOnDone() override {}

  Outer& outer_;
};

/// For MarkMethodStreamed(): `method` has the arguments of a raw callback method.
template <class Method>
[[nodiscard]] grpc::internal::MethodHandler* unary_read_first(const ServiceParts& parts, Method method,
                                                              ReadFirstLook look = nullptr) {
  return new grpc::internal::CallbackBidiHandler<grpc::ByteBuffer, grpc::ByteBuffer>(
      [&parts, method, look](grpc::CallbackServerContext* context) {
        return UnaryReadFirst::Outer::begin(parts, context, method, look);
      });
}
template <class Method>
[[nodiscard]] grpc::internal::MethodHandler* stream_read_first(const ServiceParts& parts, Method method,
                                                               ReadFirstLook look = nullptr) {
  return new grpc::internal::CallbackBidiHandler<grpc::ByteBuffer, grpc::ByteBuffer>(
      [&parts, method, look](grpc::CallbackServerContext* context) {
        return StreamReadFirst::Outer::begin(
            parts, context,
            [method](auto* of_call, const auto* request, const auto*) { return method(of_call, request); },
            look);
      });
}

/// Returns the index of a method of marble.v1, as MarkMethodStreamed() expects it.
[[nodiscard]] int method_number(const char* service, const char* method);

}  // namespace marble::server
