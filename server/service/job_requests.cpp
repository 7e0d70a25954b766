#include "service/job_requests.h"

#include <algorithm>

#include "marble/contract.h"
#include "marble/convert.h"
#include "service/job_access.h"
#include "service/job_message.h"

namespace marble::server {
namespace {

using contract::default_page, contract::largest_page;

}  // namespace

Expected<void> list_jobs(const JobBoard& board, const Identity& caller, const v1::ListJobsRequest& request,
                         v1::ListJobsResponse* response) {
  if (request.limit() < 0 || request.limit() > largest_page) {
    return unexpected(invalid("limit", std::to_string(request.limit()),
                              "must be in [0, " + std::to_string(largest_page) + "]"));
  }
  const auto visible = [&](const JobRecord& record) { return may_see(caller, record.description().client); };
  const auto passes = [&](const JobRecord& record) {
    if (!request.client().empty() && request.client() != record.description().client) return false;
    const int state = static_cast<int>(record.snapshot().state) + v1::JOB_STATE_QUEUED;
    const auto& states = request.states();
    return states.empty() || std::find(states.begin(), states.end(), state) != states.end();
  };
  const int limit = request.limit() == 0 ? default_page : request.limit();
  MARBLE_ASSIGN_OR_RETURN(
      const auto page, board.list(visible, passes, static_cast<std::size_t>(limit), request.before_job_id()));
  for (const auto& record : page.records) to_message(*record, response->add_jobs());
  response->set_more(page.more);
  return {};
}

Expected<void> get_job(const JobBoard& board, const Identity& caller, const std::string& id,
                       v1::GetJobResponse* response) {
  MARBLE_ASSIGN_OR_RETURN(const auto record, find_job(board, caller, id));
  to_message(*record, response);
  return {};
}

Expected<void> cancel_job(const JobBoard& board, const Identity& caller, const std::string& id,
                          v1::CancelJobResponse* response) {
  MARBLE_ASSIGN_OR_RETURN(const auto record, find_job(board, caller, id));
  if (!may_end(caller, record->description().client)) return unexpected(not_to_end(id));
  record->cancel();
  to_message(*record, response->mutable_job());
  return {};
}

}  // namespace marble::server
