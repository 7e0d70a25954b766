#include "http/job_routes.h"

#include <array>
#include <charconv>
#include <future>
#include <memory>

#include "http/endpoint.h"
#include "http/reply.h"
#include "marble/progress.h"
#include "service/job_access.h"
#include "service/job_bundle.h"
#include "service/job_requests.h"
#include "service/server_info.h"
#include "store/submissions.h"

namespace marble::server::http {
namespace {

constexpr std::array<const char*, 4> kStates = {"queued", "running", "idle", "finished"};  // of v1::JobState

Expected<void> read_states(const httplib::Request& request, v1::ListJobsRequest* message) {
  const std::size_t count = request.get_param_value_count("state");
  for (std::size_t i = 0; i < count; ++i) {
    const std::string name = request.get_param_value("state", i);
    const auto found = std::find(kStates.begin(), kStates.end(), name);
    if (found == kStates.end()) {
      return unexpected(
          invalid("state", static_cast<std::int64_t>(i), name, "must be queued, running, idle or finished"));
    }
    message->add_states(static_cast<v1::JobState>(found - kStates.begin() + v1::JOB_STATE_QUEUED));
  }
  return {};
}

Expected<void> read_limit(const httplib::Request& request, v1::ListJobsRequest* message) {
  if (!request.has_param("limit")) return {};
  const std::string text = request.get_param_value("limit");
  std::int32_t limit = 0;
  const char* end = text.data() + text.size();
  const auto [at, fault] = std::from_chars(text.data(), end, limit);
  if (fault != std::errc() || at != end) return unexpected(invalid("limit", text, "must be an integer"));
  message->set_limit(limit);
  return {};
}

Expected<v1::ListJobsRequest> list_request(const httplib::Request& request) {
  v1::ListJobsRequest message;
  MARBLE_RETURN_IF_ERROR(check_parameters(request, {"state", "client", "limit", "before"}));
  MARBLE_RETURN_IF_ERROR(read_states(request, &message));
  MARBLE_RETURN_IF_ERROR(read_limit(request, &message));
  message.set_client(request.get_param_value("client"));
  message.set_before_job_id(request.get_param_value("before"));
  return message;
}

// An id has only these characters; any other is replaced, because a header must not contain it.
void set_file_name(httplib::Response& response, const std::string& id, const char* ending) {
  std::string name = "marble-";
  for (const char c : id) name += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' ? c : '_';
  response.set_header("Content-Disposition", "attachment; filename=\"" + name + ending + "\"");
}

std::string trace_csv(const JobRecord::Trace& trace) {
  constexpr const char* kLineEnd = "\r\n";  // RFC 4180
  std::string text = progress_csv_header() + kLineEnd;
  for (const Progress& row : trace.rows) {
    append_progress_csv(row, text);
    text += kLineEnd;
  }
  return text;
}

/// Replies with what `ask` fills, for the job that the path names.
template <class Response, class Ask>
Answer of_job(const ServiceParts& parts, Semaphore& semaphore, Ask ask) {
  return [&parts, &semaphore, ask](const httplib::Request& request, const Identity& caller,
                                   httplib::Response& response) -> Expected<void> {
    const std::string id = request.matches[1].str();
    MARBLE_RETURN_IF_ERROR(look(parts, id));
    const auto message = std::make_shared<Response>();
    MARBLE_RETURN_IF_ERROR(ask(parts.board, caller, id, message.get()));
    return reply_long_json(response, semaphore, caller.client, message);
  };
}

// Memory per byte of request and result while a bundle is made: the bytes, their messages, their texts and
// the file.
constexpr std::int64_t kBytesOfBundle = 8;

// Called on a thread that may block.
Expected<void> reply_bundle(const ServiceParts& parts, Semaphore& semaphore, const Identity& caller,
                            const std::string& id, httplib::Response& response) {
  const auto gathered = std::make_shared<std::promise<Expected<GatheredBundle>>>();
  gather_bundle(parts, caller, id,
                [gathered](const Expected<GatheredBundle>& how) { gathered->set_value(how); });
  const auto bundle = gathered->get_future().get();
  if (!bundle) return unexpected(bundle.error());
  const auto parts_size = static_cast<std::int64_t>((*bundle)->request.size() + (*bundle)->answer.size());
  MARBLE_ASSIGN_OR_RETURN(auto memory, semaphore.hold(caller.client, kBytesOfBundle * parts_size));
  // Counts the bundle among those being sent until its file is sent.
  struct Sent {
    GatheredBundle bundle;
    std::string file;
  };
  const auto sent = std::make_shared<Sent>(Sent{*bundle, ""});
  const auto written = write_bundle(**bundle, [&](std::string_view bytes) -> Expected<void> {
    sent->file += bytes;
    return {};
  });
  if (!written) return written;
  MARBLE_RETURN_IF_ERROR(memory.resize(parts_size + static_cast<std::int64_t>(sent->file.capacity())));
  set_file_name(response, id, ".tar.zst");
  return reply_long_bytes(response, semaphore, std::move(memory), {sent, &sent->file}, "application/zstd");
}

}  // namespace

void add_job_routes(Router& router, const ServiceParts& parts, Semaphore& semaphore) {
  router.get("/api/info", endpoint(parts,
                                   [&parts](const httplib::Request&, const Identity& caller,
                                            httplib::Response& response) -> Expected<void> {
                                     v1::GetInfoResponse message;
                                     fill_info(parts, caller, &message);
                                     reply_json(response, message);
                                     return {};
                                   }));
  router.get("/api/jobs",
             endpoint(parts,
                      [&](const httplib::Request& request, const Identity& caller,
                          httplib::Response& response) -> Expected<void> {
                        MARBLE_ASSIGN_OR_RETURN(const auto asked, list_request(request));
                        MARBLE_RETURN_IF_ERROR(look(parts));
                        const auto message = std::make_shared<v1::ListJobsResponse>();
                        MARBLE_RETURN_IF_ERROR(list_jobs(parts.board, caller, asked, message.get()));
                        return reply_long_json(response, semaphore, caller.client, message);
                      }));
  router.get("/api/jobs/([^/]+)", endpoint(parts, of_job<v1::GetJobResponse>(parts, semaphore, get_job)));
  router.get("/api/jobs/([^/]+)/trace\\.csv",
             endpoint(parts,
                      [&parts](const httplib::Request& request, const Identity& caller,
                               httplib::Response& response) -> Expected<void> {
                        const std::string id = request.matches[1].str();
                        MARBLE_RETURN_IF_ERROR(look(parts, id));
                        MARBLE_ASSIGN_OR_RETURN(const auto record, find_job(parts.board, caller, id));
                        set_file_name(response, id, ".csv");
                        response.set_content(trace_csv(record->trace()),
                                             "text/csv; charset=utf-8; header=present");
                        return {};
                      }));
  router.get("/api/jobs/([^/]+)/bundle", endpoint(parts,
                                                  [&](const httplib::Request& request, const Identity& caller,
                                                      httplib::Response& response) -> Expected<void> {
                                                    const std::string id = request.matches[1].str();
                                                    MARBLE_RETURN_IF_ERROR(look(parts, id));
                                                    return reply_bundle(parts, semaphore, caller, id,
                                                                        response);
                                                  }));
  router.post("/api/jobs/([^/]+)/cancel",
              endpoint(parts,
                       [&parts](const httplib::Request& request, const Identity& caller,
                                httplib::Response& response) -> Expected<void> {
                         const std::string id = request.matches[1].str();
                         MARBLE_RETURN_IF_ERROR(look(parts, id));
                         v1::CancelJobResponse message;
                         MARBLE_ASSIGN_OR_RETURN(auto asked, parts.submissions->cancel(caller, id, &message));
                         MARBLE_RETURN_IF_ERROR(wait_for(asked));
                         reply_json(response, message);
                         return {};
                       }));
}

}  // namespace marble::server::http
