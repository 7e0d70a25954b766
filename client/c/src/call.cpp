#include <string_view>

#include "handles.h"

using marble::Expected;
using marble::unexpected;
using marble::c::change;
using marble::c::guarded;
using marble::c::null;

namespace {

std::int32_t set_seconds(marble_call* call, double marble_call::*which, double seconds, marble_error* error) {
  return change(call, "call", error, [&]() -> Expected<void> {
    if (!(seconds >= 0.0))
      return unexpected(marble::invalid("seconds", std::to_string(seconds), "must be >= 0"));
    call->*which = seconds;
    return {};
  });
}

}  // namespace

void Reporter::report(const marble::Progress& row) {
  if (function_ == nullptr) return;
  const marble_progress reported = {.iteration = row.iteration,
                                    .outer_iteration = row.outer_iteration,
                                    .factorizations = row.factorizations,
                                    .reserved = 0,
                                    .objective = row.objective,
                                    .equality_violation = row.violations.equality,
                                    .inequality_violation = row.violations.inequality,
                                    .complementarity_violation = row.violations.complementarity,
                                    .kkt_residual = row.kkt_residual,
                                    .kappa = row.kappa,
                                    .rho = row.rho,
                                    .step_length = row.step_length,
                                    .regularization = row.regularization,
                                    .elapsed_s = row.elapsed_s,
                                    .incumbent = row.incumbent,
                                    .bound = row.bound,
                                    .gap = row.gap,
                                    .nodes = row.nodes,
                                    .open_nodes = row.open_nodes};
  if (function_(&reported, user_) != 0) stop_.request_stop();
}

std::int32_t marble_call_create(marble_call** call, marble_error* error) {
  if (call != nullptr) *call = nullptr;
  return guarded(error, [&]() -> Expected<void> {
    if (call == nullptr) return unexpected(null("call"));
    *call = new marble_call();
    return {};
  });
}

void marble_call_destroy(marble_call* call) { delete call; }

std::int32_t marble_call_set_progress(marble_call* call, marble_progress_function function, void* user,
                                      marble_error* error) {
  return change(call, "call", error, [&]() -> Expected<void> {
    call->function = function;
    call->user = user;
    return {};
  });
}

std::int32_t marble_call_set_initial_z(marble_call* call, const double* z, std::int64_t count,
                                       marble_error* error) {
  return change(call, "call", error, [&]() -> Expected<void> {
    const auto given = marble::c::numbers(z, count);
    if (!given) return unexpected(marble::of_field("initial_z", given.error()));
    call->initial_z.assign(given->begin(), given->end());
    return {};
  });
}

std::int32_t marble_call_set_warm_start(marble_call* call, const marble_solution* start,
                                        marble_error* error) {
  return change(call, "call", error, [&]() -> Expected<void> {
    std::optional<marble::Solution> copy;
    if (start != nullptr) copy = start->solution;
    call->warm_start = std::move(copy);
    return {};
  });
}

std::int32_t marble_call_set_priority(marble_call* call, const char* priority, marble_error* error) {
  return change(call, "call", error, [&]() -> Expected<void> {
    if (priority == nullptr) return unexpected(null("priority"));
    using marble::Priority;
    for (const Priority known :
         {Priority::by_method, Priority::realtime, Priority::interactive, Priority::batch}) {
      if (std::string_view(priority) != marble::to_string(known)) continue;
      call->priority = known;
      return {};
    }
    return unexpected(
        marble::invalid("priority", priority, "must be by_method, realtime, interactive or batch"));
  });
}

std::int32_t marble_call_set_request_id(marble_call* call, const char* request_id, marble_error* error) {
  return change(call, "call", error, [&]() -> Expected<void> {
    if (request_id == nullptr) return unexpected(null("request_id"));
    call->request_id = request_id;
    return {};
  });
}

std::int32_t marble_call_set_deadline(marble_call* call, double seconds, marble_error* error) {
  return set_seconds(call, &marble_call::deadline_s, seconds, error);
}

std::int32_t marble_call_set_reopen(marble_call* call, double seconds, marble_error* error) {
  return set_seconds(call, &marble_call::reopen_s, seconds, error);
}

std::int32_t marble_call_set_answer_grace(marble_call* call, double seconds, marble_error* error) {
  return set_seconds(call, &marble_call::answer_grace_s, seconds, error);
}

void marble_call_cancel(marble_call* call) {
  if (call != nullptr) call->stop.source().request_stop();
}

std::int32_t marble_call_reset(marble_call* call, marble_error* error) {
  return change(call, "call", error, [&]() -> Expected<void> {
    call->stop.reset();
    return {};
  });
}
