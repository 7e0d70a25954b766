// Answers of the HTTP port: messages and errors as JSON.
#pragma once

#include <google/protobuf/message.h>
#include <httplib.h>

#include "marble/error.h"

namespace marble::server::http {

/// The JSON of a message, as protobuf defines it, with the names of the .proto files.
[[nodiscard]] std::string to_json(const google::protobuf::Message& message);

void reply_json(httplib::Response& response, const google::protobuf::Message& message);

/// {"error": {"code", "field", "index", "value", "bound", "message"}} and the HTTP status that fits.
void reply_error(httplib::Response& response, const Error& error);

}  // namespace marble::server::http
