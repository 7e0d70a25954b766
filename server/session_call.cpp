#include "session_call.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "job_log.h"
#include "marble/convert.h"
#include "random_id.h"
#include "reply.h"
#include "status.h"
#include "wire.h"

namespace marble::server {
namespace {

constexpr double kHopeless = 0.5;  // of the fastest solve so far: less time than this is not enough

Error fault(const char* field, std::string value, std::string bound) {
  return {ErrorCode::invalid_argument, field, -1, std::move(value), std::move(bound)};
}

}  // namespace

class SessionCall::SetupObserver final : public JobObserver {
 public:
  explicit SetupObserver(std::shared_ptr<SessionCall> call) : call_(std::move(call)) {}
  void finished(Outcome outcome) override { call_->set_up_done(std::move(outcome)); }

 private:
  const std::shared_ptr<SessionCall> call_;
};

class SessionCall::UpdateObserver final : public JobObserver {
 public:
  UpdateObserver(std::shared_ptr<SessionCall> call, std::shared_ptr<Update> update)
      : call_(std::move(call)), update_(std::move(update)) {}
  ProgressSink* progress() override { return call_->tell_progress_ ? call_.get() : nullptr; }
  void finished(Outcome outcome) override { call_->update_done(update_, std::move(outcome)); }

 private:
  const std::shared_ptr<SessionCall> call_;
  const std::shared_ptr<Update> update_;
};

grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* SessionCall::begin(
    const ServiceParts& parts, grpc::CallbackServerContext& context) {
  const std::shared_ptr<SessionCall> call(new SessionCall(parts));
  call->self_ = call;
  Origin origin = origin_of(context);
  const auto admit = [&]() -> Expected<void> {
    auto caller = caller_of(parts, context, origin, Role::solve);
    if (!caller) return unexpected(caller.error());
    call->caller_ = std::move(*caller);
    if (parts.scheduler.is_closed())
      return unexpected(Error{ErrorCode::unavailable, "", -1, "", "the server is draining; retry elsewhere"});
    call->quota_ = parts.access.quota_of(call->caller_.identity.client);
    auto place = parts.sessions.open(call->caller_.identity.client, call->quota_);
    if (!place) return unexpected(place.error());
    const MutexLock lock(call->mutex_);
    call->place_ = std::move(*place);
    return {};
  };
  if (const auto admitted = admit(); !admitted) {
    {
      const MutexLock lock(call->mutex_);
      call->finishing_ = true;  // a client that goes away before it has heard must not end it again
    }
    call->Finish(marble::server::refuse(parts, origin, admitted.error()));
    return call.get();
  }
  parts.pulse.add(call);
  call->go_on();
  return call.get();
}

void SessionCall::OnReadDone(bool ok) {
  v1::SessionRequest request;
  const auto parsed = ok ? parse(&incoming_, &request) : Expected<void>{};
  if (ok && parsed && request.has_setup()) {
    if (const auto taken = take_setup(*request.mutable_setup()); !taken) {
      Origin origin = caller_.origin;
      origin.request_id = request.setup().request_id();
      static_cast<void>(marble::server::refuse(parts_, origin, taken.error()));
      const MutexLock lock(mutex_);
      end(taken.error());
    }
  }
  {
    const MutexLock lock(mutex_);
    reading_ = false;
    last_activity_ = Clock::now();
    if (!ok) {
      read_all_ = true;
    } else if (!parsed) {
      end(parsed.error());
    } else if (end_ || broken_ || place_ == nullptr) {
      // Over: whatever comes is of no interest.
    } else if (request.has_update() && record_ == nullptr) {
      end({ErrorCode::failed_precondition, "update", -1, "", "comes before the set-up"});
    } else if (request.has_update()) {
      take_update(*request.mutable_update());
    } else if (!request.has_setup()) {
      end(fault("request", "", "must be a set-up or an update"));
    }
  }
  go_on();
}

Expected<void> SessionCall::take_setup(v1::SessionSetup& setup) {
  const auto inside = [](Error error, const char* path) {
    error.field = path + error.field;
    return unexpected(std::move(error));
  };
  if (record_ != nullptr) {
    return unexpected(Error{ErrorCode::failed_precondition, "setup", -1, "",
                            "the session is set up already; open another"});
  }
  if (auto valid = check_labels(setup.request_id(), setup.problem().name()); !valid)
    return inside(valid.error(), "setup.");
  const auto priority = marble::server::priority_of(setup.priority(), Priority::realtime, quota_);
  if (!priority) return inside(priority.error(), "setup.");
  if (auto valid = check_progress(setup.progress_interval_s(), setup.iterate_every(), "setup."); !valid)
    return valid;
  const auto options = options_of(setup.options(), parts_.config.solver_defaults);
  if (!options) return inside(options.error(), "setup.options.");
  const auto kept = std::make_shared<v1::SessionSetup>(std::move(setup));  // the problem borrows its arrays
  const auto problem = Problem::create(view_of(kept->problem()));
  if (!problem) {
    Error error = problem.error();
    error.field = message_field(error.field);
    return inside(std::move(error), "setup.problem.");
  }
  const auto& z = kept->initial_point().z();
  const std::span initial_z(z.data(), static_cast<std::size_t>(z.size()));
  if (auto valid = Problem::check_initial_point(initial_z, problem->variables()); !valid) {
    Error error = valid.error();
    error.field = "setup.initial_point.z";
    return unexpected(std::move(error));
  }
  const auto record = parts_.board.make({.id = random_id(),
                                         .kind = JobKind::session,
                                         .priority = *priority,
                                         .client = caller_.identity.client,
                                         .request_id = kept->request_id(),
                                         .name = kept->problem().name(),
                                         .peer = caller_.origin.peer,
                                         .variables = problem->variables(),
                                         .equalities = problem->equalities(),
                                         .inequalities = problem->inequalities(),
                                         .pairs = problem->pairs(),
                                         .trace = caller_.origin.trace},
                                        *options);
  record->set_cancel([weak = std::weak_ptr<SessionCall>(self_)] {
    const std::shared_ptr<SessionCall> call = weak.lock();
    if (call != nullptr) call->cancel({ErrorCode::cancelled, "", -1, "", "ended by Jobs.Cancel"});
  });
  std::shared_ptr<Job> job;
  {
    const MutexLock lock(mutex_);
    if (end_ || place_ == nullptr) return {};  // the client has gone meanwhile
    priority_ = *priority;
    latest_only_ = kept->latest_only();
    tell_progress_ = kept->progress();
    progress_interval_s_ = kept->progress_interval_s();
    iterate_every_ = kept->iterate_every();
    options_ = *options;
    sizes_ = PartSizes::of(*problem);
    record_ = record;
    job = job_ = make_job(Clock::time_point::max());
  }
  parts_.board.add(record);
  job->is_setup = true;
  job->ticket.bytes = static_cast<std::int64_t>(kept->ByteSizeLong());
  job->work = [this, kept, problem = *problem, options = *options,
               initial_z](const SolveControls&) -> Expected<Solution> {
    const std::int64_t most = std::min(parts_.config.solve_bytes, parts_.sessions.room());
    auto solver = WarmSolver::create(problem, options, initial_z, most);
    if (!solver) return unexpected(solver.error());
    solver_ = std::move(*solver);
    Solution prepared;
    prepared.times.setup_s = solver_->setup_s();
    return prepared;
  };
  job->observer = std::make_shared<SetupObserver>(self_);
  if (const auto admitted = parts_.scheduler.admit(job); !admitted) {
    const MutexLock lock(mutex_);
    job_ = nullptr;
    return unexpected(admitted.error());
  }
  return {};
}

void SessionCall::set_up_done(Outcome outcome) {
  {
    const MutexLock lock(mutex_);
    job_ = nullptr;
    last_activity_ = Clock::now();
    Expected<void> counted;
    if (outcome.solution) counted = place_->take(solver_->memory_bytes());
    if (!outcome.solution) {
      Error error = outcome.solution.error();
      if (!error.field.empty()) error.field = "setup." + error.field;
      end(error);
    } else if (!counted) {
      end(counted.error());
    } else {
      set_up_ = true;
      record_->set_memory(solver_->memory_bytes());
      record_->idle();
      log_session_open(parts_.log, *record_);
      v1::SessionReady* ready = events_.emplace_back().mutable_ready();
      ready->set_job_id(record_->id());
      ready->set_memory_bytes(solver_->memory_bytes());
      ready->set_setup_s(solver_->setup_s());
      ready->set_idle_timeout_s(parts_.config.session_idle_s);
    }
  }
  go_on();
}

void SessionCall::take_update(v1::SessionUpdate& message) {
  const std::int64_t sequence = message.sequence();
  if (any_update_ && sequence <= newest_sequence_) {
    return refuse(sequence, fault("update.sequence", std::to_string(sequence),
                                  "must be > " + std::to_string(newest_sequence_) + ", the one before"));
  }
  any_update_ = true;
  newest_sequence_ = sequence;
  if (parts_.scheduler.is_closed()) {
    return refuse(sequence, {ErrorCode::unavailable, "", -1, "", "the server is draining; retry elsewhere"},
                  parts_.scheduler.retry_delay_s());
  }
  const auto valid = check_update(message, sizes_);
  if (!valid) {
    Error error = valid.error();
    error.field = "update." + error.field;
    return refuse(sequence, error);
  }
  const auto options = options_of(message.options(), options_);
  if (!options) {
    Error error = options.error();
    error.field = "update.options." + error.field;
    return refuse(sequence, error);
  }
  options_ = *options;
  if (latest_only_ && !waiting_.empty()) {
    v1::SessionSuperseded* superseded = events_.emplace_back().mutable_superseded();
    superseded->set_sequence(waiting_.front()->message.sequence());
    superseded->set_by_sequence(sequence);
    parts_.metrics.update_superseded();
    take_along(std::move(waiting_.front()->message), message);
    waiting_.pop_front();
  }
  waiting_.push_back(std::make_shared<Update>(Update{std::move(message), *options, Clock::now(), false}));
}

std::shared_ptr<Job> SessionCall::make_job(Clock::time_point deadline) {
  auto job = std::make_shared<Job>();
  job->record = record_;
  job->ticket = {.client = caller_.identity.client,
                 .priority = priority_,
                 .deadline = std::min(deadline, caller_.deadline),
                 .arrival = Clock::now(),
                 .reserved = true};
  job->quota = quota_;
  return job;
}

std::shared_ptr<Job> SessionCall::next_job() {
  if (!set_up_ || job_ != nullptr || waiting_.empty() || end_ || broken_) return nullptr;
  const std::shared_ptr<Update> update = waiting_.front();
  waiting_.pop_front();
  if (left_behind_) take_along(std::move(*std::exchange(left_behind_, std::nullopt)), update->message);
  const double deadline_s = update->message.deadline_s();
  const bool limited = deadline_s > 0.0 && deadline_s < 1e9;
  const auto deadline = limited ? update->arrival + std::chrono::duration_cast<Clock::duration>(
                                                        std::chrono::duration<double>(deadline_s))
                                : Clock::time_point::max();
  job_ = make_job(deadline);
  job_->accepted = update->arrival;
  job_->ticket.bytes = static_cast<std::int64_t>(update->message.ByteSizeLong());
  job_->ticket.least_run =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(kHopeless * fastest_s_));
  solving_ = update->message.sequence();
  job_->work = [this, update, deadline](const SolveControls& controls) -> Expected<Solution> {
    update->taken = true;
    last_progress_s_ = -1.0;
    record_->set_options(update->options);
    Options options = update->options;
    const bool late_possible = deadline != Clock::time_point::max();
    if (late_possible) {
      const double left = std::chrono::duration<double>(deadline - Clock::now()).count();
      options.time_limit_s = std::clamp(left, 0.0, options.time_limit_s);
    }
    if (auto set = solver_->set_options(options); !set) return unexpected(set.error());
    auto solution =
        solver_->solve(update_of(update->message.problem()), restart_of(update->message), controls);
    if (late_possible && solution && solution->status == Status::time_limit && Clock::now() >= deadline) {
      return unexpected(
          Error{ErrorCode::deadline_exceeded, "", -1, "", "the deadline passed while the update was solved"});
    }
    return solution;
  };
  job_->observer = std::make_shared<UpdateObserver>(self_, update);
  return job_;
}

void SessionCall::update_done(const std::shared_ptr<Update>& update, Outcome outcome) {
  const std::int64_t sequence = update->message.sequence();
  {
    const MutexLock lock(mutex_);
    job_ = nullptr;
    last_activity_ = Clock::now();
    take_rows();
    if (!update->taken) left_behind_ = std::move(update->message);
    if (outcome.solution) {
      const double solve_s = outcome.solution->times.solve_s;
      fastest_s_ = fastest_s_ == 0.0 ? solve_s : std::min(fastest_s_, solve_s);
      v1::SessionAnswer* answer = events_.emplace_back().mutable_answer();
      answer->set_sequence(sequence);
      fill_solution(outcome, update->options, answer->mutable_solution());
    } else {
      refuse(sequence, outcome.solution.error(), outcome.retry_delay_s);
    }
    slot_.reset();
  }
  go_on();
}

void SessionCall::refuse(std::int64_t sequence, const Error& error, double retry_delay_s) {
  parts_.metrics.update_refused(error);
  v1::SessionError* message = events_.emplace_back().mutable_error();
  message->set_sequence(sequence);
  *message->mutable_status() = to_message(error, retry_delay_s);
}

void SessionCall::report(const Progress& progress) {
  if (last_progress_s_ >= 0.0 && progress.elapsed_s - last_progress_s_ < progress_interval_s_) return;
  last_progress_s_ = progress.elapsed_s;
  slot_.put(progress, iterate_every_ > 0 && progress.iteration % iterate_every_ == 0);
  go_on();
}

void SessionCall::take_rows() {
  const ProgressSlot::Rows taken = slot_.take();
  if (taken.rows.empty()) return;
  parts_.metrics.progress_sent(taken.rows.size(), taken.newly_skipped);
  v1::SessionProgress* progress = events_.emplace_back().mutable_progress();
  progress->set_sequence(solving_);
  fill_rows(taken, progress->mutable_progress());
}

bool SessionCall::next_event(v1::SessionResponse* event) {
  if (broken_) return false;
  if (events_.empty() && slot_.due()) take_rows();
  if (events_.empty()) return false;
  *event = std::move(events_.front());
  events_.pop_front();
  return true;
}

void SessionCall::OnWriteDone(bool ok) {
  {
    const MutexLock lock(mutex_);
    writing_ = false;
    if (!ok) broken_ = true;
  }
  go_on();
}

void SessionCall::end(const Error& reason) {
  if (!end_) end_ = reason;
  waiting_.clear();
  if (job_ != nullptr) job_->stop.request_stop();
}

void SessionCall::cancel(const Error& reason) {
  std::shared_ptr<Job> job;
  {
    const MutexLock lock(mutex_);
    end(reason);
    job = job_;
  }
  if (job != nullptr) parts_.scheduler.cancel(job);
  go_on();
}

void SessionCall::OnCancel() {
  {
    const MutexLock lock(mutex_);
    broken_ = true;
  }
  cancel({ErrorCode::cancelled, "", -1, "", "the client went away"});
}

void SessionCall::OnDone() {
  {
    const MutexLock lock(mutex_);
    release();
  }
  const auto last = std::move(self_);
}

void SessionCall::pulse(Clock::time_point now) {
  {
    const MutexLock lock(mutex_);
    if (finishing_ || end_) return;
    const bool quiet = job_ == nullptr && waiting_.empty();
    const auto idle = std::chrono::duration<double>(now - last_activity_).count();
    if (parts_.scheduler.is_closed()) {
      if (!quiet) return;  // what was accepted is answered
      end({ErrorCode::unavailable, "", -1, "", "the server is draining; set the session up elsewhere"});
    } else if (quiet && idle > parts_.config.session_idle_s) {
      end({ErrorCode::aborted, "session_idle_s", -1, "",
           "no update for " + std::to_string(std::lround(idle)) + " s"});
    } else if (!slot_.due()) {  // rows that waited for others
      return;
    }
  }
  go_on();
}

// Gives everything back as soon as the session is over, whoever still reads its last answers.
void SessionCall::release() {
  if (place_ == nullptr || job_ != nullptr) return;
  place_ = nullptr;
  solver_.reset();
  if (record_ == nullptr) return;
  record_->closed(end_);
  parts_.board.finish(record_);
  log_session_end(parts_.log, *record_, end_);
}

// A thread of ours may ask for a read while gRPC's tells that the client is gone. Finishing waits until it
// has asked: afterwards gRPC may be done with the call, and asking would use memory it has freed.
void SessionCall::go_on() {
  while (step()) {
  }
}

// gRPC may react within StartRead, StartWrite or Finish, on this very thread, and a job may be answered
// within admit(): no lock is held there.
bool SessionCall::step() {
  v1::SessionResponse event;
  std::shared_ptr<Job> job;
  bool read = false;
  bool write = false;
  bool finish = false;
  grpc::Status status;
  {
    const MutexLock lock(mutex_);
    job = next_job();
    const auto room = static_cast<std::size_t>(parts_.config.session_updates);
    read = !reading_ && !read_all_ && !end_ && !finishing_ && waiting_.size() + events_.size() < room;
    reading_ = reading_ || read;
    starting_ += read ? 1 : 0;
    if (!writing_ && !finishing_) {
      write = next_event(&event);
      writing_ = write;
      const bool over = (end_.has_value() || (read_all_ && waiting_.empty())) && job_ == nullptr;
      if (over) release();
      finish = over && !write && starting_ == 0;
      finishing_ = finish;
      if (finish && end_) status = to_status(*end_, 0.0);
    }
  }
  if (job != nullptr) {
    if (const auto admitted = parts_.scheduler.admit(job); !admitted) {
      Outcome outcome;
      outcome.solution = unexpected(admitted.error());
      outcome.retry_delay_s = parts_.scheduler.retry_delay_s();
      job->observer->finished(std::move(outcome));
      job->observer = nullptr;
    }
  }
  if (read) StartRead(&incoming_);
  if (write) {
    grpc::ByteBuffer bytes = serialize(event);
    {
      const MutexLock lock(mutex_);  // the next write comes from any thread
      outgoing_.Swap(&bytes);
    }
    StartWrite(&outgoing_);
  } else if (finish) {
    Finish(status);
  }
  if (!read) return false;
  const MutexLock lock(mutex_);
  --starting_;
  return true;
}

}  // namespace marble::server
