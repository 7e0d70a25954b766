#include "http/requests/reply.h"

#include <google/protobuf/util/json_util.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "wire/status.h"

namespace marble::server::http {
namespace {

constexpr const char* kJson = "application/json";

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
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string text;
  const auto status = google::protobuf::util::MessageToJsonString(message, &text, options);
  return status.ok() ? text : "null";
}

void reply_text(httplib::Response& response, std::string json) {
  response.body = std::move(json);
  response.set_header("Content-Type", kJson);
}

void reply_json(httplib::Response& response, const google::protobuf::Message& message) {
  reply_text(response, to_json(message));
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
