#include "session_setup.h"

#include <utility>

#include "marble/convert.h"
#include "random_id.h"

namespace marble::server {

Expected<CheckedSetup> check_setup(v1::SessionSetup& setup, const Quota& quota, const Options& defaults) {
  if (auto valid = check_labels(setup.request_id(), setup.problem().name()); !valid)
    return unexpected(inside("setup", valid.error()));
  const auto priority = priority_of(setup.priority(), Priority::realtime, quota);
  if (!priority) return unexpected(inside("setup", priority.error()));
  if (auto valid = check_progress(setup.progress_interval_s(), setup.iterate_every(), "setup."); !valid)
    return unexpected(valid.error());
  const auto options = options_of(setup.options(), defaults);
  if (!options) return unexpected(inside("setup.options", options.error()));
  const auto message = std::make_shared<v1::SessionSetup>(std::move(setup));
  const auto problem = Problem::create(view_of(message->problem()));
  if (!problem) {
    const Error& error = problem.error();
    return unexpected(inside("setup.problem", of_field(message_field(error.field), error)));
  }
  const auto& z = message->initial_point().z();
  const std::span initial_z(z.data(), static_cast<std::size_t>(z.size()));
  if (auto valid = Problem::check_initial_point(initial_z, problem->variables()); !valid)
    return unexpected(of_field("setup.initial_point.z", valid.error()));
  return CheckedSetup{message, *problem, *options, *priority, initial_z};
}

std::shared_ptr<JobRecord> make_record(const JobBoard& board, const Caller& caller,
                                       const CheckedSetup& setup) {
  return board.make({.id = random_id(),
                     .kind = JobKind::session,
                     .priority = setup.priority,
                     .client = caller.identity.client,
                     .request_id = setup.message->request_id(),
                     .name = setup.message->problem().name(),
                     .peer = caller.origin.peer,
                     .variables = setup.problem.variables(),
                     .equalities = setup.problem.equalities(),
                     .inequalities = setup.problem.inequalities(),
                     .pairs = setup.problem.pairs(),
                     .trace = caller.origin.trace},
                    setup.options);
}

}  // namespace marble::server
