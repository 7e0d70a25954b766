#include <cstring>

#include "handles.h"

using marble::Expected;
using marble::unexpected;
using marble::c::guarded;
using marble::c::in_use;
using marble::c::null;

namespace {

// Passes the jobs of the client, or of the server of MARBLE_SERVER, to `work`.
template <class Work>
std::int32_t with_jobs(const marble_client* client, const char* job_id, marble_error* error,
                       const Work& work) {
  return guarded(error, [&]() -> Expected<void> {
    if (job_id == nullptr) return unexpected(null("job_id"));
    return marble::c::with_client(client, [&](const marble::Client& where) { return work(where.jobs()); });
  });
}

}  // namespace

std::int32_t marble_job_submit(const marble_client* client, const marble_problem* problem,
                               const marble_options* options, marble_call* call, char* job_id,
                               marble_error* error) {
  if (job_id != nullptr) job_id[0] = '\0';
  return with_jobs(client, job_id, error, [&](const marble::Jobs& jobs) -> Expected<void> {
    if (problem == nullptr) return unexpected(null("problem"));
    const marble_call none;
    const marble_call& given = call == nullptr ? none : *call;
    const std::shared_lock reading(problem->usage, std::try_to_lock);
    if (!reading) return unexpected(in_use("problem"));
    const std::shared_lock reading_call(given.usage, std::try_to_lock);
    if (!reading_call) return unexpected(in_use("call"));
    marble::SensitivityRequest wanted;
    MARBLE_ASSIGN_OR_RETURN(
        const auto taken,
        jobs.submit(problem->problem.view(), options == nullptr ? marble::Options() : options->options,
                    given.controls(nullptr, wanted), given.over(problem->problem.name)));
    if (taken.job_id.size() >= MARBLE_JOB_ID_SIZE) {
      return unexpected(failure(marble::ErrorCode::internal, "job_id", taken.job_id,
                                "must have less than " + std::to_string(MARBLE_JOB_ID_SIZE) + " bytes"));
    }
    std::memcpy(job_id, taken.job_id.c_str(), taken.job_id.size() + 1);
    return {};
  });
}

std::int32_t marble_job_state(const marble_client* client, const char* job_id, const char** state,
                              marble_error* error) {
  if (state != nullptr) *state = nullptr;
  return with_jobs(client, job_id, error, [&](const marble::Jobs& jobs) -> Expected<void> {
    if (state == nullptr) return unexpected(null("state"));
    MARBLE_ASSIGN_OR_RETURN(const auto found, jobs.get(job_id));
    *state = marble::to_string(found.job.state);
    return {};
  });
}

std::int32_t marble_job_result(const marble_client* client, const char* job_id, std::int32_t wait,
                               marble_call* call, marble_solution** solution, marble_error* error) {
  if (solution != nullptr) *solution = nullptr;
  return with_jobs(client, job_id, error, [&](const marble::Jobs& jobs) -> Expected<void> {
    if (solution == nullptr) return unexpected(null("solution"));
    const marble_call none;
    const marble_call& given = call == nullptr ? none : *call;
    const std::shared_lock reading_call(given.usage, std::try_to_lock);
    if (!reading_call) return unexpected(in_use("call"));
    MARBLE_ASSIGN_OR_RETURN(auto answer, jobs.result(job_id, {.wait = wait != 0,
                                                              .deadline = given.deadline(),
                                                              .stop = given.stop.source().get_token()}));
    *solution = new marble_solution{std::move(answer)};
    return {};
  });
}

std::int32_t marble_job_cancel(const marble_client* client, const char* job_id, marble_error* error) {
  return with_jobs(client, job_id, error, [&](const marble::Jobs& jobs) -> Expected<void> {
    MARBLE_RETURN_IF_ERROR(jobs.cancel(job_id));
    return {};
  });
}

std::int32_t marble_job_remove(const marble_client* client, const char* job_id, marble_error* error) {
  return with_jobs(client, job_id, error,
                   [&](const marble::Jobs& jobs) -> Expected<void> { return jobs.remove(job_id); });
}
