#include "reply.h"

#include <limits>
#include <new>

#include "marble/convert.h"
#include "status.h"

namespace marble::server {

constexpr std::size_t kLargestMessage = std::numeric_limits<std::int32_t>::max();  // protobuf's own

grpc::Status fill_response(const Job& job, const Outcome& outcome, v1::SolveResponse* response) {
  if (!outcome.solution) {
    Error error = outcome.solution.error();
    if (error.code == ErrorCode::internal) error.bound += " (job " + job.id + ")";
    return to_status(error, outcome.retry_delay_s);
  }
  try {
    response->set_job_id(job.id);
    v1::Solution* solution = response->mutable_solution();
    to_message(*outcome.solution, solution);
    to_message(job.options, solution->mutable_options());
    solution->mutable_times()->set_queue_s(outcome.queue_s);
    solution->mutable_times()->set_total_s(outcome.total_s);
    if (response->ByteSizeLong() <= kLargestMessage) return grpc::Status::OK;
    return to_status(
        {ErrorCode::resource_exhausted, "solution", -1, "", "the answer is too large for a message"});
  } catch (const std::bad_alloc&) {
    return to_status(out_of_memory(), outcome.retry_delay_s);
  }
}

void log_refusal(const Log& log, const std::string& peer, const std::string& request_id, const Error& error) {
  // The id may be what is wrong with the request: show no more of it than a good one may have.
  log.info("refused", {{"request", request_id.substr(0, kLongestRequestId)},
                       {"peer", peer},
                       {"code", std::string(to_string(error.code))},
                       {"reason", error.message()}});
}

}  // namespace marble::server
