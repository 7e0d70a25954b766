// Answers of the HTTP port: messages and errors as JSON.
#pragma once

#include <google/protobuf/message.h>
#include <httplib.h>

#include <memory>
#include <string>

#include "http/requests/places.h"
#include "marble/error.h"

namespace marble::server::http {

/// The JSON of a message, as protobuf defines it, with the names of the .proto files.
[[nodiscard]] std::string to_json(const google::protobuf::Message& message);

void reply_json(httplib::Response& response, const google::protobuf::Message& message);

/// A message of any length: where it is long, its JSON is made as it is sent. The message, `memory` and a
/// thread are held until the last byte is sent or the connection ends. Errors: resource_exhausted.
[[nodiscard]] Expected<void> reply_long_json(httplib::Response& response, Places& places,
                                             Places::Place memory,
                                             std::shared_ptr<const google::protobuf::Message> message);
/// The same of a message that is not counted yet, for this client.
[[nodiscard]] Expected<void> reply_long_json(httplib::Response& response, Places& places,
                                             const std::string& client,
                                             std::shared_ptr<const google::protobuf::Message> message);

/// Bytes that were made already, kept and held likewise.
[[nodiscard]] Expected<void> reply_long_bytes(httplib::Response& response, Places& places,
                                              Places::Place memory, std::shared_ptr<const std::string> bytes,
                                              const char* type);

/// JSON that was made already.
void reply_text(httplib::Response& response, std::string json);

/// {"error": {"code", "field", "index", "value", "bound", "message"}} and the HTTP status that fits. Where
/// the same may be taken later, after how many seconds.
void reply_error(httplib::Response& response, const Error& error, double retry_delay_s = 1.0);

/// What became of a job without a solution: {"job_id", "error"}.
void reply_failed_job(httplib::Response& response, const std::string& id, const Error& error);

}  // namespace marble::server::http
