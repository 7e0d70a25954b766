// What all data routes have in common: they identify the caller first, and a refusal is sent and logged.
#pragma once

#include <httplib.h>

#include <functional>

#include "service/service_parts.h"
#include "store/submissions.h"

namespace marble::server::http {

/// Fills the response for a caller, or returns an error.
using Answer = std::function<Expected<void>(const httplib::Request&, const Identity&, httplib::Response&)>;

[[nodiscard]] httplib::Server::Handler endpoint(const ServiceParts& parts, Answer answer);

/// Submissions::look(), on a thread that may block.
[[nodiscard]] Expected<void> look(const ServiceParts& parts, const std::string& id = "");
/// Called on a thread that may block.
[[nodiscard]] Expected<void> wait_for(const OnFinished& afterwards);

/// Sends the error to the client and logs it.
void refuse(const Log& log, const httplib::Request& request, const Error& error, httplib::Response& response);

/// An error unless every parameter of the query is one of these. Errors: invalid_argument.
[[nodiscard]] Expected<void> check_parameters(const httplib::Request& request,
                                              std::initializer_list<const char*> known);

}  // namespace marble::server::http
