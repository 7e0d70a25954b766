#include "http/endpoint.h"

#include <algorithm>
#include <future>
#include <memory>
#include <utility>

#include "http/caller.h"
#include "http/reply.h"
#include "jobs/job_log.h"

namespace marble::server::http {

void refuse(const Log& log, const httplib::Request& request, const Error& error,
            httplib::Response& response) {
  log_refusal(log, Origin{credentials_of(request).peer}, error);
  reply_error(response, error);
}

httplib::Server::Handler endpoint(const ServiceParts& parts, Answer answer) {
  return [&parts, answer = std::move(answer)](const httplib::Request& request, httplib::Response& response) {
    const auto caller = parts.access.identify(credentials_of(request));
    const Expected<void> done =
        caller ? answer(request, *caller, response) : Expected<void>(unexpected(caller.error()));
    if (!done) refuse(parts.log, request, done.error(), response);
  };
}

Expected<void> wait_for(const OnFinished& afterwards) {
  if (!afterwards) return {};
  const auto ended = std::make_shared<std::promise<Expected<void>>>();
  afterwards([ended](const Expected<void>& how) { ended->set_value(how); });
  return ended->get_future().get();
}

Expected<void> look(const ServiceParts& parts, const std::string& id) {
  return wait_for([&](CompletionCallback settled) { parts.submissions->look(id, std::move(settled)); });
}

Expected<void> check_parameters(const httplib::Request& request, std::initializer_list<const char*> known) {
  for (const auto& [name, value] : request.params) {
    const auto same = [&name = name](const char* one) { return name == one; };
    if (std::any_of(known.begin(), known.end(), same)) continue;
    std::string rule = "is no parameter here";
    for (const char* one : known)
      rule += (one == *known.begin() ? ", which takes " : ", ") + std::string(one);
    return unexpected(invalid(name, value, rule));
  }
  return {};
}

}  // namespace marble::server::http
