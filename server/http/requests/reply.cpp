#include "http/requests/reply.h"

#include <google/protobuf/util/json_util.h>

#include <nlohmann/json.hpp>

namespace marble::server::http {
namespace {

constexpr const char* kJson = "application/json";

int status_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::invalid_argument:
    case ErrorCode::failed_precondition:
      return 400;
    case ErrorCode::unauthenticated:
      return 401;
    case ErrorCode::permission_denied:
      return 403;
    case ErrorCode::not_found:
      return 404;
    case ErrorCode::resource_exhausted:
      return 429;
    case ErrorCode::unavailable:
      return 503;
    default:
      return 500;
  }
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

void reply_json(httplib::Response& response, const google::protobuf::Message& message) {
  response.set_content(to_json(message), kJson);
}

void reply_error(httplib::Response& response, const Error& error) {
  const nlohmann::json body = {{"error",
                                {{"code", to_string(error.code)},
                                 {"field", error.field},
                                 {"index", error.index},
                                 {"value", error.value},
                                 {"bound", error.bound},
                                 {"message", error.message()}}}};
  response.status = status_of(error.code);
  if (error.code == ErrorCode::unauthenticated) response.set_header("WWW-Authenticate", "Bearer");
  response.set_content(body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace), kJson);
}

}  // namespace marble::server::http
