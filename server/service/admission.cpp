#include "service/admission.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "base/random_id.h"
#include "base/status.h"
#include "jobs/job_log.h"
#include "marble/contract.h"
#include "marble/convert.h"
#include "service/coupled_work.h"
#include "service/scenario_work.h"
#include "service/solve_head.h"

namespace marble::server {
namespace {

Clock::time_point deadline_of(const grpc::CallbackServerContext& context) {
  // gRPC gives an absolute wall time; jobs are timed by the steady clock.
  const auto left = context.deadline() - std::chrono::system_clock::now();
  if (left > std::chrono::hours(24 * 365)) return Clock::time_point::max();
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(left);
}

Priority default_priority(JobKind kind) {
  if (kind == JobKind::session) return Priority::realtime;
  return kind == JobKind::batch || kind == JobKind::array ? Priority::batch : Priority::interactive;
}

// Returns the requested priority, but none higher than the quota allows.
Expected<Priority> priority_of(v1::Priority asked, JobKind kind, const Quota& quota) {
  if (asked == v1::PRIORITY_UNSPECIFIED) return std::max(default_priority(kind), quota.priority);
  if (asked < v1::PRIORITY_REALTIME || asked > v1::PRIORITY_BATCH) {
    return unexpected(invalid("priority", std::to_string(asked), "must be in [0, 3]"));
  }
  const auto priority = static_cast<Priority>(asked - v1::PRIORITY_REALTIME);
  if (priority < quota.priority) {
    return unexpected(failure(ErrorCode::permission_denied, "priority", to_string(priority),
                              std::string("the client's highest priority is ") + to_string(quota.priority)));
  }
  return priority;
}

Expected<void> check_labels(const std::string& request_id, const std::string& problem_name,
                            const char* field_of_name) {
  if (request_id.size() > contract::longest_request_id) {
    return unexpected(
        invalid("request_id", std::to_string(request_id.size()) + " bytes",
                "must have at most " + std::to_string(contract::longest_request_id) + " bytes"));
  }
  const auto printable = [](unsigned char c) { return c >= 0x20 && c < 0x7f; };
  if (!std::all_of(request_id.begin(), request_id.end(), printable)) {
    return unexpected(invalid("request_id", "must be printable ASCII"));
  }
  if (problem_name.size() > contract::longest_problem_name) {
    return unexpected(
        invalid(field_of_name, std::to_string(problem_name.size()) + " bytes",
                "must have at most " + std::to_string(contract::longest_problem_name) + " bytes"));
  }
  return {};
}

// An array may have its own name.
template <class Message>
const std::string& name_of(const Message& message) {
  if constexpr (requires { message.name(); }) {
    if (!message.name().empty()) return message.name();
  }
  return message.problem().name();
}

// The fields that every request has, of any kind.
struct Common {
  Options options;
  Priority priority;
};

// True if the option `explain` has a meaning for the request.
template <class Message>
bool is_of_one_problem(JobKind kind, const Message& message) {
  if constexpr (requires { message.has_coupled(); }) {
    if (message.has_coupled() || message.has_scenarios()) return false;
  }
  return kind != JobKind::session && kind != JobKind::scenarios && kind != JobKind::coupled;
}

template <class Message>
Expected<Common> check_common(const ServiceParts& parts, const Quota& quota, JobKind kind,
                              const Message& message) {
  MARBLE_RETURN_IF_ERROR(check_labels(message.request_id(), message.problem().name(), "problem.name"));
  if constexpr (requires { message.name(); }) {
    MARBLE_RETURN_IF_ERROR(check_labels("", message.name(), "name"));
  }
  MARBLE_ASSIGN_OR_RETURN(const auto priority, priority_of(message.priority(), kind, quota));
  auto options = options_of(message.options(), parts.config.solver_defaults);
  if (!options) return unexpected(inside("options", options.error()));
  if (auto valid = validate(*options); !valid) return unexpected(inside("options", valid.error()));
  if (const bool alone = is_of_one_problem(kind, message); !alone) {
    if (message.options().explain()) {
      if (auto valid = validate_without_explain(*options); !valid)
        return unexpected(inside("options", valid.error()));
    }
    options->explain = false;  // the server's default applies only to solves that support it
  }
  return Common{*std::move(options), priority};
}

template <class Message>
std::shared_ptr<JobRecord> make_record(const ServiceParts& parts, const Caller& caller, JobKind kind,
                                       const Message& message, const Common& common,
                                       const BlockPlace& sizes) {
  if (caller.earlier && caller.earlier->record != nullptr) {
    caller.earlier->record->set_options(common.options);
    return caller.earlier->record;
  }
  return parts.board.make(
      {.id = caller.earlier ? caller.earlier->id : random_id(),
       .kind = kind,
       .priority = common.priority,
       .client = caller.identity.client,
       .request_id = message.request_id(),
       .name = name_of(message),
       .peer = caller.origin.peer,
       .variables = sizes.variables,
       .equalities = sizes.equalities,
       .inequalities = sizes.inequalities,
       .pairs = sizes.pairs,
       .trace = caller.origin.trace,
       .accepted = caller.earlier ? caller.earlier->accepted : std::chrono::system_clock::now()},
      common.options);
}

template <class Message>
Expected<CheckedRequest> check(const ServiceParts& parts, const Caller& caller, const Quota& quota,
                               JobKind kind, const Message& message) {
  MARBLE_ASSIGN_OR_RETURN(const auto common, check_common(parts, quota, kind, message));
  const auto problem = Problem::create(view_of(message.problem()));
  if (!problem) {
    const Error& error = problem.error();
    return unexpected(inside("problem", of_field(message_field(error.field), error)));
  }
  const auto& z = message.initial_point().z();
  const std::span initial_z(z.data(), static_cast<std::size_t>(z.size()));
  if (auto valid = Problem::check_initial_point(initial_z, problem->variables()); !valid)
    return unexpected(of_field(message_field(valid.error().field), valid.error()));
  std::optional<Solution> warm_start;
  if constexpr (requires { message.warm_start(); }) {
    if (message.has_warm_start()) {
      warm_start = solution_of(message.warm_start());
      if (auto valid = check_warm_start(*warm_start, PartSizes::of(*problem)); !valid)
        return unexpected(of_field(message_field(valid.error().field), valid.error()));
    }
  }
  std::optional<CheckedSensitivity> sensitivity;
  if constexpr (requires { message.sensitivity(); }) {
    if (message.has_sensitivity()) {
      MARBLE_ASSIGN_OR_RETURN(sensitivity, checked_sensitivity(message.sensitivity(), PartSizes::of(*problem),
                                                               SensitivityLimits::of(parts.config)));
    }
  }
  auto record =
      make_record(parts, caller, kind, message, common,
                  {problem->variables(), problem->equalities(), problem->inequalities(), problem->pairs()});
  return CheckedRequest{*problem,         common.options,        common.priority,
                        initial_z,        std::move(warm_start), std::move(sensitivity),
                        std::move(record)};
}

// Requests whose sizes have the same number of bits, with the same number of starts, asked or not, form one
// class: they run for about as long.
int work_class_of(std::int64_t bytes, const Options& options) {
  const auto bits = [](std::int64_t number) {
    return static_cast<int>(std::bit_width(static_cast<std::uint64_t>(number)));
  };
  const auto starts = options.num_starts + static_cast<std::int64_t>(options.effort);
  return 128 * bits(starts) + 2 * bits(bytes) + (options.global_search ? 1 : 0);
}

// Makes the job of a request of so many bytes, without its record and its work.
std::shared_ptr<Job> job_of(const Caller& caller, const Quota& quota, std::int64_t bytes,
                            const Common& common) {
  auto job = std::make_shared<Job>();
  if (caller.earlier) {
    const auto age = std::chrono::system_clock::now() - caller.earlier->accepted;
    job->accepted -= std::chrono::duration_cast<Clock::duration>(age);
  }
  job->ticket = {.client = caller.identity.client,
                 .priority = common.priority,
                 .deadline = caller.deadline,
                 .arrival = Clock::now(),
                 .bytes = bytes};
  job->ticket.work_class = work_class_of(bytes, common.options);
  job->quota = quota;
  job->time_limit_s = common.options.time_limit_s;
  return job;
}

}  // namespace

Expected<Caller> caller_of(const ServiceParts& parts, const grpc::CallbackServerContext& context,
                           Origin& origin, Role role) {
  MARBLE_ASSIGN_OR_RETURN(auto identity, parts.access.require(context, role));
  origin.client = identity.client;
  parts.connections.known(origin.peer);
  return Caller{std::move(identity), origin, deadline_of(context)};
}

Expected<Identity> identify(const ServiceParts& parts, const grpc::CallbackServerContext& context,
                            Origin& origin) {
  auto identity = parts.access.identify(context);
  if (identity) {
    origin.client = identity->client;
    parts.connections.known(origin.peer);
  } else {
    log_refusal(parts.log, origin, identity.error());
  }
  return identity;
}

Expected<CheckedRequest> check_request(const ServiceParts& parts, const Caller& caller, const Quota& quota,
                                       JobKind kind, const v1::SessionSetup& message) {
  return check(parts, caller, quota, kind, message);
}

Expected<CheckedArray> check_request(const ServiceParts& parts, const Caller& caller, const Quota& quota,
                                     const v1::ArraySetup& message) {
  MARBLE_ASSIGN_OR_RETURN(const auto common, check_common(parts, quota, JobKind::array, message));
  CheckedArray array{common.options, common.priority, std::nullopt, nullptr};
  BlockPlace sizes;
  if (message.has_problem()) {
    const auto problem = Problem::create(view_of(message.problem()));
    if (!problem) {
      const Error& error = problem.error();
      return unexpected(inside("problem", of_field(message_field(error.field), error)));
    }
    array.base = PartSizes::of(*problem);
    sizes = {problem->variables(), problem->equalities(), problem->inequalities(), problem->pairs()};
  }
  array.record = make_record(parts, caller, JobKind::array, message, common, sizes);
  return array;
}

Expected<void> check_progress(double interval_s, std::int32_t iterate_every) {
  if (!(interval_s >= 0.0))
    return unexpected(invalid("progress_interval_s", std::to_string(interval_s), "must be >= 0"));
  if (iterate_every < 0)
    return unexpected(invalid("iterate_every", std::to_string(iterate_every), "must be >= 0"));
  return {};
}

Expected<std::shared_ptr<Job>> make_job(const ServiceParts& parts, const Caller& caller, JobKind kind,
                                        std::shared_ptr<const v1::SolveRequest> message) {
  const Quota quota = parts.access.quota_of(caller.identity.client);
  const auto bytes = static_cast<std::int64_t>(message->ByteSizeLong());
  if (kind == JobKind::solve && message->has_scenarios()) kind = JobKind::scenarios;
  if (kind == JobKind::solve && message->has_coupled()) kind = JobKind::coupled;
  if (has_blocks(*message)) {
    MARBLE_ASSIGN_OR_RETURN(const auto common, check_common(parts, quota, kind, *message));
    MARBLE_ASSIGN_OR_RETURN(const auto sizes, check_blocks(parts.config, *message));
    auto job = job_of(caller, quota, bytes, common);
    job->record = make_record(parts, caller, kind, *message, common, sizes);
    auto set = set_coupled_work(parts.config, std::move(message), common.options, *job);
    return set ? Expected<std::shared_ptr<Job>>(std::move(job)) : unexpected(set.error());
  }
  auto checked = check(parts, caller, quota, kind, *message);
  if (!checked) return unexpected(checked.error());
  auto job = job_of(caller, quota, bytes, {checked->options, checked->priority});
  job->record = checked->record;
  if (checked->sensitivity) job->ticket.bytes += checked->sensitivity->bytes;
  if (message->has_scenarios() || message->has_coupled()) {
    const auto set_work = message->has_coupled() ? set_coupled_work : set_scenario_work;
    auto set = set_work(parts.config, std::move(message), checked->options, *job);
    return set ? Expected<std::shared_ptr<Job>>(std::move(job)) : unexpected(set.error());
  }
  // The problem borrows the message's arrays.
  job->work = [message = std::move(message), checked = std::move(*checked),
               limits = SetupControls{.most_bytes = parts.config.solve_bytes,
                                      .most_factorization_s = parts.config.solve_seconds}](
                  const SolveControls& given) {
    SolveControls controls = given;
    controls.initial_z = checked.initial_z;
    controls.warm_start = checked.warm_start ? &*checked.warm_start : nullptr;
    controls.sensitivity = checked.sensitivity ? &checked.sensitivity->request : nullptr;
    const auto report_memory = [&](const Solver& solver) {
      checked.record->set_memory(solver.memory_bytes());
    };
    return solve_once(checked.problem, checked.options, controls, limits, report_memory);
  };
  return job;
}

Expected<void> refuse_early(const ServiceParts& parts, const Caller& caller, const grpc::ByteBuffer& request,
                            Origin& origin, int field) {
  if (caller.deadline == Clock::time_point::max() || parts.scheduler.free_workers() > 0) return {};
  const auto head = read_head(request, field);
  if (!head) return {};
  const Quota quota = parts.access.quota_of(caller.identity.client);
  const auto common = check_common(parts, quota, JobKind::solve, head->fields);
  if (!common) return {};
  origin.request_id = head->fields.request_id();
  return parts.scheduler.may_enter(job_of(caller, quota, head->bytes, *common));
}

void note_refusal(const ServiceParts& parts, const Origin& origin, const Error& error) {
  parts.scheduler.count_refused(error);
  log_refusal(parts.log, origin, error);
}

grpc::Status refused(const ServiceParts& parts, const Origin& origin, const Error& error) {
  note_refusal(parts, origin, error);
  return to_status(error, parts.scheduler.retry_delay_s());
}

grpc::Status end_of_stream(const ServiceParts& parts, const Error& error) {
  return to_status(error, error.code == ErrorCode::unavailable ? parts.scheduler.retry_delay_s() : 0.0);
}

}  // namespace marble::server
