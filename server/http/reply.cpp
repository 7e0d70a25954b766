#include "http/reply.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/status.h"
#include "message_json.h"

namespace marble::server::http {
namespace {

constexpr const char* kJson = "application/json";
constexpr std::uint64_t kShort = 64 << 10;  // bytes; as much as a socket takes at once

int status_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::invalid_argument:
      return 400;
    case ErrorCode::unauthenticated:
      return 401;
    case ErrorCode::permission_denied:
      return 403;
    case ErrorCode::not_found:
      return 404;
    case ErrorCode::failed_precondition:
      return 409;
    case ErrorCode::resource_exhausted:
      return 429;
    case ErrorCode::unavailable:
      return 503;
    default:
      return 500;
  }
}

nlohmann::json json_of(const Error& whole) {
  const Error error = abridged(whole);
  return {{"code", to_string(error.code)}, {"field", error.field}, {"index", error.index},
          {"value", error.value},          {"bound", error.bound}, {"message", error.message()}};
}

std::string text_of(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

std::string to_json(const google::protobuf::Message& message) {
  std::string text;
  write_message_json(message, [&](std::string_view piece) {
    text += piece;
    return true;
  });
  return text;
}

void reply_text(httplib::Response& response, std::string json) {
  response.body = std::move(json);
  response.set_header("Content-Type", kJson);
}

void reply_json(httplib::Response& response, const google::protobuf::Message& message) {
  reply_text(response, to_json(message));
}

namespace {

// Provides `length` bytes, all of them in one call; `put` writes them until the sink takes no more. What it
// owns lives as long as the response.
template <class Put>
Expected<void> reply_held(httplib::Response& response, Semaphore& semaphore, Semaphore::Permit memory,
                          std::uint64_t length, const char* type, const Put& put) {
  MARBLE_ASSIGN_OR_RETURN(auto thread, semaphore.stay());
  const auto held =
      std::make_shared<std::pair<Semaphore::Permit, Semaphore::Permit>>(std::move(memory), std::move(thread));
  response.set_content_provider(
      static_cast<std::size_t>(length), type, [held, put](std::size_t, std::size_t, httplib::DataSink& sink) {
        return put([&sink](std::string_view piece) { return sink.write(piece.data(), piece.size()); });
      });
  return {};
}

}  // namespace

Expected<void> reply_long_json(httplib::Response& response, Semaphore& semaphore, Semaphore::Permit memory,
                               std::shared_ptr<const google::protobuf::Message> message) {
  std::string text;  // JSON of a short message
  std::uint64_t length = 0;
  write_message_json(*message, [&](std::string_view piece) {
    length += piece.size();
    if (length <= kShort) text += piece;
    return true;
  });
  if (length <= kShort) {
    reply_text(response, std::move(text));
    return {};
  }
  const auto size = static_cast<std::int64_t>(message->SpaceUsedLong()) + kJsonPieceBytes;
  MARBLE_RETURN_IF_ERROR(memory.resize(size));
  return reply_held(response, semaphore, std::move(memory), length, kJson,
                    [message](const TextSink& sink) { return write_message_json(*message, sink); });
}

Expected<void> reply_long_json(httplib::Response& response, Semaphore& semaphore, const std::string& client,
                               std::shared_ptr<const google::protobuf::Message> message) {
  MARBLE_ASSIGN_OR_RETURN(auto memory, semaphore.hold(client, 0));
  return reply_long_json(response, semaphore, std::move(memory), std::move(message));
}

Expected<void> reply_long_bytes(httplib::Response& response, Semaphore& semaphore, Semaphore::Permit memory,
                                std::shared_ptr<const std::string> bytes, const char* type) {
  const std::size_t length = bytes->size();
  return reply_held(response, semaphore, std::move(memory), length, type,
                    [bytes](const TextSink& sink) { return sink(*bytes); });
}

void reply_error(httplib::Response& response, const Error& error, double retry_delay_s) {
  response.status = status_of(error.code);
  if (error.code == ErrorCode::unauthenticated) response.set_header("WWW-Authenticate", "Bearer");
  if (retry_may_help(error.code) && retry_delay_s > 0.0)
    response.set_header("Retry-After", std::to_string(static_cast<std::int64_t>(std::ceil(retry_delay_s))));
  reply_text(response, text_of({{"error", json_of(error)}}));
}

void reply_failed_job(httplib::Response& response, const std::string& id, const Error& error) {
  reply_text(response, text_of({{"job_id", id}, {"error", json_of(error)}}));
}

}  // namespace marble::server::http
