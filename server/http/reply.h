// Replies of the HTTP port: messages and errors as JSON.
#pragma once

#include <google/protobuf/message.h>
#include <httplib.h>

#include <memory>
#include <string>

#include "http/semaphore.h"
#include "marble/error.h"

namespace marble::server::http {

/// Returns the JSON of a message, as protobuf defines it, with the names of the .proto files.
[[nodiscard]] std::string to_json(const google::protobuf::Message& message);

void reply_json(httplib::Response& response, const google::protobuf::Message& message);

/// Sends a message of any length; the JSON of a long one is made while it is sent. The message, `memory` and
/// a thread are held until the last byte is sent or the connection ends. Errors: resource_exhausted.
[[nodiscard]] Expected<void> reply_long_json(httplib::Response& response, Semaphore& semaphore,
                                             Semaphore::Permit memory,
                                             std::shared_ptr<const google::protobuf::Message> message);
/// The same for a message whose memory is not counted yet, for this client.
[[nodiscard]] Expected<void> reply_long_json(httplib::Response& response, Semaphore& semaphore,
                                             const std::string& client,
                                             std::shared_ptr<const google::protobuf::Message> message);

/// The same for existing bytes.
[[nodiscard]] Expected<void> reply_long_bytes(httplib::Response& response, Semaphore& semaphore,
                                              Semaphore::Permit memory,
                                              std::shared_ptr<const std::string> bytes, const char* type);

/// Sends existing JSON.
void reply_text(httplib::Response& response, std::string json);

/// Sends {"error": {"code", "field", "index", "value", "bound", "message"}} with the matching HTTP status.
/// If the same request may be accepted later, also the number of seconds to wait.
void reply_error(httplib::Response& response, const Error& error, double retry_delay_s = 1.0);

/// Sends the end of a job without a solution: {"job_id", "error"}.
void reply_failed_job(httplib::Response& response, const std::string& id, const Error& error);

}  // namespace marble::server::http
