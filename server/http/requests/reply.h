// Answers of the HTTP port: messages and errors as JSON.
#pragma once

#include <google/protobuf/message.h>
#include <httplib.h>

#include "marble/error.h"

namespace marble::server::http {

/// The JSON of a message, as protobuf defines it, with the names of the .proto files.
[[nodiscard]] std::string to_json(const google::protobuf::Message& message);

void reply_json(httplib::Response& response, const google::protobuf::Message& message);

/// JSON that was made already.
void reply_text(httplib::Response& response, std::string json);

/// {"error": {"code", "field", "index", "value", "bound", "message"}} and the HTTP status that fits. Where
/// the same may be taken later, after how many seconds.
void reply_error(httplib::Response& response, const Error& error, double retry_delay_s = 1.0);

/// What became of a job without a solution: {"job_id", "error"}.
void reply_failed_job(httplib::Response& response, const std::string& id, const Error& error);

}  // namespace marble::server::http
