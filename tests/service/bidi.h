// One bidirectional call, message by message.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <optional>
#include <vector>

namespace marble::testing {

template <class Request, class Response>
class Bidi {
 public:
  /// `open` makes the call with the context given.
  template <class OpenCall>
  explicit Bidi(OpenCall&& open) : stream_(open(&context_)) {}
  ~Bidi() {
    context_.TryCancel();
    (void)finish();
  }
  Bidi(const Bidi&) = delete;
  Bidi& operator=(const Bidi&) = delete;

  bool write(const Request& request) { return stream_->Write(request); }
  void done() { stream_->WritesDone(); }
  /// The next message, or nothing at the stream's end.
  [[nodiscard]] std::optional<Response> next() {
    Response response;
    if (!stream_->Read(&response)) return std::nullopt;
    return response;
  }
  /// All messages to the end.
  [[nodiscard]] std::vector<Response> drain() {
    std::vector<Response> all;
    while (auto response = next()) all.push_back(std::move(*response));
    return all;
  }
  /// The status, after the end.
  grpc::Status finish() {
    if (!finished_) {
      while (next()) {
      }
      status_ = stream_->Finish();
    }
    finished_ = true;
    return status_;
  }
  void cancel() { context_.TryCancel(); }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<Request, Response>> stream_;
  grpc::Status status_;
  bool finished_ = false;
};

}  // namespace marble::testing
