#include "admission.h"

#include <absl/random/random.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "marble/convert.h"

namespace marble::server {
namespace {

std::string new_job_id() {
  thread_local absl::BitGen generator;
  char text[17];
  std::snprintf(text, sizeof text, "%016llx",
                static_cast<unsigned long long>(absl::Uniform<std::uint64_t>(generator)));
  return text;
}

Error fault(std::string field, std::string value, std::string bound) {
  return {ErrorCode::invalid_argument, std::move(field), -1, std::move(value), std::move(bound)};
}

Clock::time_point deadline_of(const grpc::CallbackServerContext& context) {
  // gRPC tells an absolute wall time; jobs are timed by the steady clock.
  const auto left = context.deadline() - std::chrono::system_clock::now();
  if (left > std::chrono::hours(24 * 365)) return Clock::time_point::max();
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(left);
}

}  // namespace

Expected<std::shared_ptr<Job>> make_job(std::shared_ptr<const v1::SolveRequest> message,
                                        const grpc::CallbackServerContext& context) {
  const v1::SolveRequest& request = *message;
  const std::string& id = request.request_id();
  if (id.size() > kLongestRequestId) {
    return unexpected(fault("request_id", std::to_string(id.size()) + " bytes",
                            "must have at most " + std::to_string(kLongestRequestId) + " bytes"));
  }
  if (!std::all_of(id.begin(), id.end(), [](unsigned char c) { return c >= 0x20 && c < 0x7f; })) {
    return unexpected(fault("request_id", "", "must be printable ASCII"));
  }
  if (request.problem().name().size() > kLongestName) {
    return unexpected(fault("problem.name", std::to_string(request.problem().name().size()) + " bytes",
                            "must have at most " + std::to_string(kLongestName) + " bytes"));
  }
  auto options = options_of(request.options());
  if (!options) {
    Error error = options.error();
    error.field = "options." + error.field;
    return unexpected(std::move(error));
  }
  auto problem = Problem::create(view_of(request.problem()));
  if (!problem) {
    Error error = problem.error();
    error.field = "problem." + message_field(error.field);
    return unexpected(std::move(error));
  }
  const auto& z = request.initial_point().z();
  const std::span initial_z(z.data(), static_cast<std::size_t>(z.size()));
  if (auto valid = Problem::check_initial_point(initial_z, problem->variables()); !valid) {
    Error error = valid.error();
    error.field = "initial_point.z";
    return unexpected(std::move(error));
  }
  auto job = std::make_shared<Job>(Job{.id = new_job_id(),
                                       .request_id = id,
                                       .name = request.problem().name(),
                                       .peer = context.peer(),
                                       .request = std::move(message),
                                       .problem = *problem,
                                       .options = *options,
                                       .initial_z = initial_z,
                                       .bytes = static_cast<std::int64_t>(request.ByteSizeLong()),
                                       .deadline = deadline_of(context)});
  return job;
}

}  // namespace marble::server
