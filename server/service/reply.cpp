#include "service/reply.h"

#include <limits>

#include "base/status.h"
#include "marble/convert.h"

namespace marble::server {

constexpr std::size_t kLargestMessage = std::numeric_limits<std::int32_t>::max();  // protobuf's own

void fill_solution(const Outcome& outcome, const Options& options, v1::Solution* message) {
  to_message(*outcome.solution, message);
  if (outcome.also) outcome.also(message);
  to_message(options, message->mutable_options());
  message->mutable_times()->set_queue_s(outcome.queue_s);
  message->mutable_times()->set_total_s(outcome.total_s);
}

Expected<void> fill_response(const JobRecord& job, const Outcome& outcome, v1::SolveResponse* response) {
  if (!outcome.solution) {
    Error error = outcome.solution.error();
    if (error.code == ErrorCode::internal) error.bound += " (job " + job.id() + ")";
    return unexpected(std::move(error));
  }
  const auto fill = [&]() -> Expected<void> {
    response->set_job_id(utf8(job.id()));
    fill_solution(outcome, job.options(), response->mutable_solution());
    if (response->ByteSizeLong() <= kLargestMessage) return {};
    return unexpected(
        failure(ErrorCode::resource_exhausted, "solution", "the answer is too large for a message"));
  };
  return or_out_of_memory(fill, does_not_fit);
}

void fill_rows(const ProgressSlot::Rows& taken, const JobRecord& record, v1::ProgressRows* message) {
  for (const Progress& row : taken.rows) to_message(row, message->add_rows());
  if (!taken.rows.empty())
    message->mutable_rows()->rbegin()->mutable_z()->Assign(taken.newest_z.begin(), taken.newest_z.end());
  message->set_skipped(taken.skipped);
  to_message(record.activity().read(), message->mutable_activity());
}

}  // namespace marble::server
