#include "http/submission_routes.h"

#include <future>
#include <limits>
#include <memory>
#include <optional>

#include "base/wire.h"
#include "http/bounded_server.h"
#include "http/browser_guard.h"
#include "http/caller.h"
#include "http/endpoint.h"
#include "http/reply.h"
#include "http/solve_request.h"
#include "http/waiting.h"
#include "service/admission.h"
#include "service/job_access.h"
#include "store/submissions.h"

namespace marble::server::http {
namespace {

// Memory per byte of a body: its text, numbers in vectors and in a message.
constexpr std::int64_t kBytesOfBody = 8;
// Memory per byte of a result while it is read: integers of one byte become four.
constexpr std::int64_t kBytesOfAnswer = 4;

constexpr std::int64_t kAllFields = std::numeric_limits<std::int64_t>::max() / 4;  // for its own messages

constexpr std::chrono::seconds kMoment{5};  // time in which a job that has ended gets its result

// Reads the text of a body, for an identified caller.
Expected<std::string> read_body(const httplib::ContentReader& read, Semaphore& semaphore, std::size_t length,
                                int* status) {
  std::optional<Semaphore::Permit> stays;
  if (length > BoundedServer::kOrdinaryBody) {
    MARBLE_ASSIGN_OR_RETURN(auto place, semaphore.stay());
    stays.emplace(std::move(place));
  }
  std::string text;
  text.reserve(length);
  read([&](const char* bytes, std::size_t size) {
    if (size > length - text.size()) return false;
    text.append(bytes, size);
    return true;
  });
  if (text.size() == length) return text;
  *status = 408;
  return unexpected(invalid("body", std::to_string(text.size()) + " bytes",
                            "must have the " + std::to_string(length) + " of Content-Length, in time"));
}

// Fills the response, or returns an error, and the status if it differs from the error's.
Expected<void> submit_body(const ServiceParts& parts, Semaphore& semaphore, const httplib::Request& request,
                           const httplib::ContentReader& read, Origin& origin, httplib::Response& response,
                           int* status) {
  MARBLE_ASSIGN_OR_RETURN(auto identity, parts.access.require(credentials_of(request), Role::solve));
  origin.client = identity.client;
  if (!is_json(request) || request.has_header("Content-Encoding")) {
    *status = 415;
    return unexpected(invalid("Content-Type", request.get_header_value("Content-Type"),
                              "must be application/json, without a Content-Encoding"));
  }
  if (!request.has_header("Content-Length") || request.has_header("Transfer-Encoding")) {
    *status = 411;
    return unexpected(invalid("Content-Length", "must be there: a body has no pieces here"));
  }
  const auto length = request.get_header_value<std::uint64_t>("Content-Length");
  const auto memory = semaphore.hold(identity.client, kBytesOfBody * static_cast<std::int64_t>(length));
  if (!memory) return unexpected(memory.error());
  std::shared_ptr<v1::SolveRequest> message;
  {
    MARBLE_ASSIGN_OR_RETURN(const auto text, read_body(read, semaphore, length, status));
    MARBLE_ASSIGN_OR_RETURN(message, solve_request_of(text, parts.config.message_bytes));
  }
  origin.request_id = message->request_id();
  v1::SubmitResponse answer;
  MARBLE_ASSIGN_OR_RETURN(const auto submitted,
                          parts.submissions->submit({identity, origin}, std::move(message), &answer));
  MARBLE_RETURN_IF_ERROR(wait_for(submitted));
  response.status = 202;
  response.set_header("Location", std::string(kJobsPath) + "/" + answer.job_id());
  reply_json(response, answer);
  return {};
}

httplib::Server::HandlerWithContentReader submitting(const ServiceParts& parts, Semaphore& semaphore) {
  return [&parts, &semaphore](const httplib::Request& request, httplib::Response& response,
                              const httplib::ContentReader& read) {
    Origin origin = origin_of(request);
    if (origin.trace) response.set_header("traceparent", to_traceparent(*origin.trace));
    int status = 0;
    const auto done = or_out_of_memory(
        [&] { return submit_body(parts, semaphore, request, read, origin, response, &status); });
    if (done) return;
    note_refusal(parts, origin, done.error());
    reply_error(response, done.error(), parts.scheduler.retry_delay_s());
    if (status != 0) response.status = status;
  };
}

Error no_answer(const std::string& id) {
  return failure(ErrorCode::not_found, "job_id", id,
                 "is no submitted job, or its answer is not kept any more");
}

Error deleted(const std::string& id) {
  return failure(ErrorCode::not_found, "job_id", id, "was deleted, and its answer with it");
}

// Returns the result once it exists; null if it does not in time. Errors: not_found (dropped meanwhile),
// unavailable (the server shuts down).
Expected<ResultStore::Shared> wait_for_answer(const ServiceParts& parts, const std::string& id,
                                              Clock::time_point until) {
  const auto reported = std::make_shared<std::promise<ResultStore::Shared>>();
  auto answer = reported->get_future();
  parts.results.wait(id, reported.get(),
                     [reported](const ResultStore::Shared& result) { reported->set_value(result); });
  while (answer.wait_for(std::min<Clock::duration>(kLook, until - Clock::now())) !=
         std::future_status::ready) {
    const bool ends = parts.scheduler.is_drained() && parts.submissions->is_settled();
    if (!ends && Clock::now() < until) continue;
    parts.results.stop_waiting(id, reported.get());
    if (answer.wait_for(std::chrono::seconds(0)) == std::future_status::ready) break;
    return ends ? Expected<ResultStore::Shared>(unexpected(draining())) : ResultStore::Shared();
  }
  auto result = answer.get();
  if (result == nullptr) return unexpected(deleted(id));
  return result;
}

Answer answering(const ServiceParts& parts, Semaphore& semaphore) {
  return [&parts, &semaphore](const httplib::Request& request, const Identity& caller,
                              httplib::Response& response) -> Expected<void> {
    const std::string id = request.matches[1].str();
    MARBLE_RETURN_IF_ERROR(check_parameters(request, {"wait"}));
    MARBLE_ASSIGN_OR_RETURN(const auto wait_s, wait_of(parts, request));
    MARBLE_RETURN_IF_ERROR(look(parts, id));
    const std::string owner = parts.results.owner(id);
    if (owner.empty() || !may_end(caller, owner)) return unexpected(no_answer(id));
    auto result = parts.results.get(id);
    if (result == nullptr) {
      const auto record = parts.board.find(id);
      const bool over = record == nullptr || record->is_finished();
      std::unique_ptr<Waiting> waiting;
      if (!over && wait_s > 0.0) {
        MARBLE_ASSIGN_OR_RETURN(waiting, Waiting::begin(parts, semaphore, caller.client));
      }
      const auto patience =
          std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(wait_s));
      MARBLE_ASSIGN_OR_RETURN(
          result,
          wait_for_answer(parts, id,
                          Clock::now() + (over ? std::max<Clock::duration>(patience, kMoment) : patience)));
      // tokens and roles can be reloaded
      MARBLE_ASSIGN_OR_RETURN(const auto still, parts.access.identify(credentials_of(request)));
      if (!may_end(still, owner)) return unexpected(no_answer(id));
    }
    if (result == nullptr) {
      response.set_header("Retry-After", "1");
      return unexpected(
          failure(ErrorCode::failed_precondition, "job_id", id, "has not finished; wait, or come back"));
    }
    if (!result->answer) {
      reply_failed_job(response, id, result->answer.error());
      return {};
    }
    grpc::ByteBuffer bytes(*result->answer);  // reading removes a buffer's bytes
    auto memory = semaphore.hold(caller.client, kBytesOfAnswer * static_cast<std::int64_t>(bytes.Length()));
    if (!memory) return unexpected(memory.error());
    const auto message = std::make_shared<v1::SolveResponse>();
    if (auto parsed = parse(&bytes, message.get(), kAllFields); !parsed)
      return unexpected(failure(ErrorCode::internal, "the answer that is kept cannot be read"));
    return reply_long_json(response, semaphore, *std::move(memory), message);
  };
}

}  // namespace

void add_submission_routes(Router& router, const ServiceParts& parts, Semaphore& semaphore) {
  router.post_unread(kJobsPath, submitting(parts, semaphore));
  router.get("/api/jobs/([^/]+)/result", endpoint(parts, answering(parts, semaphore)));
  router.del("/api/jobs/([^/]+)", endpoint(parts,
                                           [&parts](const httplib::Request& request, const Identity& caller,
                                                    httplib::Response& response) -> Expected<void> {
                                             const std::string id = request.matches[1].str();
                                             MARBLE_RETURN_IF_ERROR(look(parts, id));
                                             MARBLE_ASSIGN_OR_RETURN(const auto removed,
                                                                     parts.submissions->remove(caller, id));
                                             MARBLE_RETURN_IF_ERROR(wait_for(removed));
                                             reply_json(response, v1::DeleteJobResponse());
                                             return {};
                                           }));
}

}  // namespace marble::server::http
