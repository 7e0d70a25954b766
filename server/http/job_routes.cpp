#include "http/job_routes.h"

#include <array>
#include <charconv>

#include "http/requests/endpoint.h"
#include "http/requests/reply.h"
#include "marble/progress.h"
#include "messages/job_access.h"
#include "messages/job_requests.h"
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
  if (auto known = check_parameters(request, {"state", "client", "limit", "before"}); !known)
    return unexpected(known.error());
  if (auto read = read_states(request, &message); !read) return unexpected(read.error());
  if (auto read = read_limit(request, &message); !read) return unexpected(read.error());
  message.set_client(request.get_param_value("client"));
  message.set_before_job_id(request.get_param_value("before"));
  return message;
}

// Of the characters of an id nothing else can come; a header is no place to find out.
std::string file_name(const std::string& id) {
  std::string name = "marble-";
  for (const char c : id) name += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' ? c : '_';
  return name + ".csv";
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

/// Answers with what `ask` fills, for the job that the path names.
template <class Response, class Ask>
Answer of_job(const ServiceParts& parts, Ask ask) {
  return [&parts, ask](const httplib::Request& request, const Identity& caller,
                       httplib::Response& response) -> Expected<void> {
    const std::string id = request.matches[1].str();
    if (auto looked = look(parts, id); !looked) return looked;
    Response message;
    if (auto asked = ask(parts.board, caller, id, &message); !asked) return asked;
    reply_json(response, message);
    return {};
  };
}

}  // namespace

void add_job_routes(Router& router, const ServiceParts& parts) {
  router.get("/api/info", endpoint(parts,
                                   [&parts](const httplib::Request&, const Identity& caller,
                                            httplib::Response& response) -> Expected<void> {
                                     v1::GetInfoResponse message;
                                     fill_info(parts, caller, &message);
                                     reply_json(response, message);
                                     return {};
                                   }));
  router.get("/api/jobs", endpoint(parts,
                                   [&parts](const httplib::Request& request, const Identity& caller,
                                            httplib::Response& response) -> Expected<void> {
                                     const auto asked = list_request(request);
                                     if (!asked) return unexpected(asked.error());
                                     if (auto looked = look(parts); !looked) return looked;
                                     v1::ListJobsResponse message;
                                     if (auto listed = list_jobs(parts.board, caller, *asked, &message);
                                         !listed)
                                       return listed;
                                     reply_json(response, message);
                                     return {};
                                   }));
  router.get("/api/jobs/([^/]+)", endpoint(parts, of_job<v1::GetJobResponse>(parts, get_job)));
  router.get("/api/jobs/([^/]+)/trace\\.csv",
             endpoint(parts,
                      [&parts](const httplib::Request& request, const Identity& caller,
                               httplib::Response& response) -> Expected<void> {
                        const std::string id = request.matches[1].str();
                        if (auto looked = look(parts, id); !looked) return looked;
                        const auto record = find_job(parts.board, caller, id);
                        if (!record) return unexpected(record.error());
                        response.set_header("Content-Disposition",
                                            "attachment; filename=\"" + file_name(id) + "\"");
                        response.set_content(trace_csv((*record)->trace()),
                                             "text/csv; charset=utf-8; header=present");
                        return {};
                      }));
  router.post("/api/jobs/([^/]+)/cancel",
              endpoint(parts,
                       [&parts](const httplib::Request& request, const Identity& caller,
                                httplib::Response& response) -> Expected<void> {
                         const std::string id = request.matches[1].str();
                         if (auto looked = look(parts, id); !looked) return looked;
                         v1::CancelJobResponse message;
                         auto asked = parts.submissions->cancel(caller, id, &message);
                         if (!asked) return unexpected(asked.error());
                         if (auto kept = wait_for(*asked); !kept) return kept;
                         reply_json(response, message);
                         return {};
                       }));
}

}  // namespace marble::server::http
