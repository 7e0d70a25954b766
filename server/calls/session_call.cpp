#include "calls/session_call.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/status.h"
#include "base/wire.h"
#include "jobs/job_log.h"
#include "marble/convert.h"
#include "service/reply.h"

namespace marble::server {
namespace {

// Number of whole updates that a session has memory for besides its solver: one that waits, or the changes
// left for the next, and one that is not parsed yet. Others take memory from the queue's bytes.
constexpr std::int64_t kUpdates = 2;
constexpr int kUnreadAnswers = 2;  // no more is solved for a client that does not read

}  // namespace

grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* SessionCall::begin(
    const ServiceParts& parts, grpc::CallbackServerContext& context) {
  const std::shared_ptr<SessionCall> call(new SessionCall(parts));
  call->self_ = call;
  Origin origin = origin_of(context);
  const auto admit = [&]() -> Expected<void> {
    MARBLE_ASSIGN_OR_RETURN(call->caller_, caller_of(parts, context, origin, Role::solve));
    if (parts.scheduler.is_closed()) return unexpected(draining());
    call->quota_ = parts.access.quota_of(call->caller_.identity.client);
    MARBLE_ASSIGN_OR_RETURN(auto place, parts.sessions.open(call->caller_.identity.client, call->quota_));
    const MutexLock lock(call->mutex_);
    call->place_ = std::move(place);
    return {};
  };
  if (const auto admitted = admit(); !admitted) {
    call->end_at_once(refused(parts, origin, admitted.error()));
    return call.get();
  }
  parts.timer.add(call);
  call->go_on();
  return call.get();
}

void SessionCall::received(grpc::ByteBuffer* message) {
  const MutexLock lock(mutex_);
  last_activity_ = Clock::now();
  if (message == nullptr || end_ || broken() || place_ == nullptr) return;  // ignored
  unread_.emplace();
  unread_->Swap(message);
}

bool SessionCall::may_read() const {
  const auto room = static_cast<std::size_t>(parts_.config.session_updates);
  const std::size_t waiting = waiting_ ? waiting_->size() : 0;
  return !parsing_ && !unread_ && !end_ && waiting + events_.size() < room;
}

// A message is parsed when there is memory for the result: in the session, for one that waits, else among
// the queue's bytes. Tried again whenever an update has left.
bool SessionCall::take_unread(grpc::ByteBuffer* bytes, std::unique_ptr<Scheduler::Held>* room) {
  if (!unread_ || parsing_) return false;
  if (waiting_ && !waiting_->has_room()) {
    const std::size_t length = std::max<std::size_t>(1, unread_->Length());
    *room = parts_.scheduler.hold(caller_.identity.client, static_cast<std::int64_t>(length), quota_);
    if (*room == nullptr) return false;
  }
  bytes->Swap(&*unread_);
  unread_.reset();
  parsing_ = true;
  return true;
}

// One message at a time, by the thread that found that there was memory.
void SessionCall::take_message(grpc::ByteBuffer& bytes, std::unique_ptr<Scheduler::Held> room) {
  v1::SessionRequest request;
  const auto parsed = record_ == nullptr
                          ? parse(&bytes, &request)
                          : parse_update(bytes, sizes_, &request, SensitivityLimits::of(parts_.config).bytes);
  if (parsed && request.has_setup()) {
    Origin origin = caller_.origin;
    origin.request_id = request.setup().request_id();
    const auto setup = std::make_shared<const v1::SessionSetup>(std::move(*request.mutable_setup()));
    if (const auto taken = take_setup(setup); !taken) {
      note_refusal(parts_, origin, taken.error());
      const MutexLock lock(mutex_);
      end(taken.error());
    }
  }
  const MutexLock lock(mutex_);
  parsing_ = false;
  if (!parsed) {
    end(parsed.error());
  } else if (end_ || broken() || place_ == nullptr) {
    // The session has ended meanwhile.
  } else if (request.has_update() && record_ == nullptr) {
    end(failure(ErrorCode::failed_precondition, "update", "comes before the set-up"));
  } else if (request.has_update()) {
    take_update(*request.mutable_update(), std::move(room));
  } else if (!request.has_setup()) {
    end(invalid("request", "must be a set-up or an update"));
  }
}

Expected<void> SessionCall::take_setup(const std::shared_ptr<const v1::SessionSetup>& message) {
  if (record_ != nullptr) {
    return unexpected(
        failure(ErrorCode::failed_precondition, "setup", "the session is set up already; open another"));
  }
  if (auto valid = check_progress(message->progress_interval_s(), message->iterate_every()); !valid)
    return unexpected(inside("setup", valid.error()));
  if (message->epoch() < 0)
    return unexpected(invalid("setup.epoch", std::to_string(message->epoch()), "must be >= 0"));
  const auto setup = check_request(parts_, caller_, quota_, JobKind::session, *message);
  if (!setup) return unexpected(inside("setup", setup.error()));
  const std::shared_ptr<JobRecord> record = setup->record;
  record->set_cancel([weak = std::weak_ptr<SessionCall>(self_)] {
    const std::shared_ptr<SessionCall> call = weak.lock();
    if (call != nullptr) call->cancel(failure(ErrorCode::cancelled, "ended by Jobs.Cancel"));
  });
  std::shared_ptr<Job> job;
  {
    const MutexLock lock(mutex_);
    if (end_ || place_ == nullptr) return {};  // the client has disconnected meanwhile
    priority_ = setup->priority;
    report_progress_ = message->progress();
    progress_interval_s_ = message->progress_interval_s();
    iterate_every_ = message->iterate_every();
    epoch_ = message->epoch();
    options_ = setup->options;
    sizes_ = PartSizes::of(setup->problem);
    waiting_.emplace(message->latest_only());
    record_ = record;
    job = job_ = make_job(Clock::time_point::max());
  }
  parts_.board.add(record);
  job->is_setup = true;
  job->ticket.bytes = static_cast<std::int64_t>(message->ByteSizeLong());
  job->work = [this, message, setup = *setup](const SolveControls& controls) -> Expected<Solution> {
    const SetupControls limits{.most_bytes = std::min(parts_.config.solve_bytes, parts_.sessions.room()),
                               .most_factorization_s = parts_.config.solve_seconds,
                               .stop = controls.stop,
                               .pause = controls.pause};
    MARBLE_ASSIGN_OR_RETURN(solver_,
                            WarmSolver::create(setup.problem, setup.options, setup.initial_z, limits));
    solver_->set_most_misses(parts_.config.session_misses);
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
    const std::int64_t bytes =
        outcome.solution ? solver_->memory_bytes() + kUpdates * most_update_bytes(sizes_) : 0;
    if (outcome.solution) counted = place_->take(bytes);
    if (!outcome.solution) {
      Error error = inside("setup", outcome.solution.error());
      if (error.code == ErrorCode::cancelled && parts_.scheduler.is_closed())
        error = draining("set the session up elsewhere");
      end(error);
    } else if (!counted) {
      end(counted.error());
    } else {
      set_up_ = true;
      record_->set_memory(bytes);
      record_->idle();
      log_session_open(parts_.log, *record_);
      v1::SessionReady* ready = events_.emplace_back().mutable_ready();
      ready->set_job_id(record_->id());
      ready->set_memory_bytes(bytes);
      ready->set_setup_s(solver_->setup_s());
      ready->set_idle_timeout_s(parts_.config.session_idle_s);
      ready->set_epoch(epoch_);
    }
  }
  go_on();
}

void SessionCall::take_update(v1::SessionUpdate& message, std::unique_ptr<Scheduler::Held> room) {
  const std::int64_t sequence = message.sequence();
  if (message.epoch() != epoch_) {
    return refuse(sequence,
                  failure(ErrorCode::failed_precondition, "update.epoch", std::to_string(message.epoch()),
                          "must be " + std::to_string(epoch_) + ", that of this session's set-up"));
  }
  if (any_update_ && sequence <= newest_sequence_) {
    return refuse(sequence, invalid("update.sequence", std::to_string(sequence),
                                    "must be > " + std::to_string(newest_sequence_) + ", the one before"));
  }
  any_update_ = true;
  newest_sequence_ = sequence;
  if (parts_.scheduler.is_closed()) {
    return refuse(sequence, draining(), parts_.scheduler.retry_delay_s());
  }
  auto update = Update::check(message, sizes_, options_, SensitivityLimits::of(parts_.config));
  if (!update) return refuse(sequence, update.error());
  if (const std::int64_t bytes = update->sensitivity_bytes(); bytes > 0)
    update->give_sensitivity_room(parts_.scheduler.hold(caller_.identity.client, bytes, quota_));
  options_ = update->options();
  const auto older = waiting_->push(std::make_shared<Update>(std::move(*update)), std::move(room));
  if (!older) return;
  v1::SessionSuperseded* superseded = events_.emplace_back().mutable_superseded();
  superseded->set_sequence(*older);
  superseded->set_by_sequence(sequence);
  parts_.metrics.update_superseded();
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
  if (!set_up_ || job_ != nullptr || waiting_->empty() || answers_ >= kUnreadAnswers || end_ || broken())
    return nullptr;
  const std::shared_ptr<Update> update = waiting_->pop();
  job_ = make_job(update->deadline());
  job_->accepted = update->arrival();
  job_->ticket.bytes = update->bytes();
  job_->ticket.may_preempt = true;
  job_->time_limit_s = update->options().time_limit_s;
  job_->is_preparation = update->prepares();
  solving_ = update->sequence();
  job_->work = [this, update](const SolveControls& controls) -> Expected<Solution> {
    update->taken = true;
    last_progress_s_ = -1.0;
    if (report_progress_) slot_.started();
    record_->set_options(update->options());
    if (update->prepares()) {
      MARBLE_RETURN_IF_ERROR(
          solver_->prepare(update->checked(), {.stop = controls.stop, .pause = controls.pause}));
      Solution ready;
      ready.status = Status::solved;
      ready.detail = "prepared";
      return ready;
    }
    const auto derivatives = update->sensitivity();
    SolveControls own = controls;
    own.sensitivity = derivatives ? &*derivatives : nullptr;
    auto solution = solver_->solve(update->checked(), own);
    if (solution && update->lacks_sensitivity_room()) {
      solution->sensitivity = unexpected(failure(ErrorCode::failed_precondition, "sensitivity_bytes",
                                                 "the server has no room for derivatives now"));
    }
    return solution;
  };
  job_->observer = std::make_shared<UpdateObserver>(self_, update);
  return job_;
}

void SessionCall::update_done(const std::shared_ptr<Update>& update, Outcome outcome) {
  const std::int64_t sequence = update->sequence();
  {
    const MutexLock lock(mutex_);
    job_ = nullptr;
    last_activity_ = Clock::now();
    take_rows();
    if (!update->taken && !end_) waiting_->leave_behind(std::move(*update));
    if (update->prepares()) {
      record_->idle();
      if (!outcome.solution && update->taken)
        refuse(sequence, outcome.solution.error(), outcome.retry_delay_s);
    } else if (outcome.solution) {
      ++answers_;
      const std::int64_t restarts = solver_->restarts();
      if (restarts > restarts_) parts_.metrics.session_restarted();
      restarts_ = restarts;
      v1::SessionAnswer* answer = events_.emplace_back().mutable_answer();
      answer->set_sequence(sequence);
      answer->set_epoch(epoch_);
      answer->set_restarts(restarts);
      fill_solution(outcome, update->options(), answer->mutable_solution());
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
  message->set_epoch(epoch_);
  *message->mutable_status() = to_message(error, retry_delay_s);
}

void SessionCall::report(const Progress& progress) {
  if (last_progress_s_ >= 0.0 && progress.elapsed_s - last_progress_s_ < progress_interval_s_) return;
  last_progress_s_ = progress.elapsed_s;
  slot_.put(progress, iterate_every_ > 0 && progress.iteration % iterate_every_ == 0);
  go_on();
}

void SessionCall::take_rows() {
  const bool quiet = job_ != nullptr && slot_.is_quiet();
  const ProgressSlot::Rows taken = slot_.take();
  if (taken.rows.empty() && !quiet) return;
  parts_.metrics.progress_sent(taken.rows.size(), taken.newly_skipped);
  v1::SessionProgress* progress = events_.emplace_back().mutable_progress();
  progress->set_sequence(solving_);
  fill_rows(taken, *record_, progress->mutable_progress());
}

bool SessionCall::next_event(v1::SessionResponse* event) {
  if (events_.empty() && (slot_.due() || slot_.is_quiet())) take_rows();
  if (events_.empty()) return false;
  *event = std::move(events_.front());
  events_.pop_front();
  if (event->has_answer()) --answers_;
  return true;
}

bool SessionCall::wrote() {
  last_activity_ = Clock::now();
  return true;
}

void SessionCall::end(const Error& reason) {
  if (!end_) end_ = reason;
  if (waiting_) waiting_->clear();
  unread_.reset();
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

void SessionCall::gone() { cancel(failure(ErrorCode::cancelled, "the client went away")); }

void SessionCall::done() {
  const MutexLock lock(mutex_);
  release();
}

void SessionCall::on_timer(Clock::time_point now) {
  {
    const MutexLock lock(mutex_);
    if (finishing() || end_) return;
    const bool stalled = job_ == nullptr && answers_ > 0;  // behind a write that does not end
    const bool quiet = job_ == nullptr && !parsing_ && (!waiting_ || waiting_->empty());
    const auto idle = std::chrono::duration<double>(now - last_activity_).count();
    if (parts_.scheduler.is_closed()) {
      if (!quiet) return;  // accepted updates still get their results
      end(draining("set the session up elsewhere"));
    } else if ((quiet || stalled) && idle > parts_.config.session_idle_s) {
      end(failure(ErrorCode::aborted, "session_idle_s",
                  (stalled ? "no answer was read for " : "no update for ") +
                      std::to_string(std::lround(idle)) + " s"));
    } else if (!slot_.due() && !slot_.is_quiet()) {  // rows that waited for others
      return;
    }
  }
  go_on();
}

// Releases everything as soon as the session is over, even if its client still reads its last results.
void SessionCall::release() {
  if (place_ == nullptr || job_ != nullptr) return;
  place_ = nullptr;
  solver_.reset();
  if (record_ == nullptr) return;
  record_->closed(end_);
  parts_.board.finish(record_);
  log_session_end(parts_.log, *record_, end_);
}

bool SessionCall::is_over() const {
  const bool none_waits = !unread_ && (!waiting_ || waiting_->empty());
  return (end_ || (read_all() && none_waits)) && job_ == nullptr && !parsing_;
}

std::optional<grpc::Status> SessionCall::ending() {
  if (!is_over()) return std::nullopt;
  return end_ ? end_of_stream(parts_, *end_) : grpc::Status::OK;
}

// Handles the next message, or else starts the next job, which may finish within admit(): no lock is held
// during it.
bool SessionCall::work() {
  grpc::ByteBuffer message;
  std::unique_ptr<Scheduler::Held> room;
  std::shared_ptr<Job> job;
  bool parse = false;
  {
    const MutexLock lock(mutex_);
    parse = take_unread(&message, &room);
    if (!parse) job = next_job();
    if (is_over()) release();
  }
  if (parse) take_message(message, std::move(room));
  if (job == nullptr) return parse;
  if (const auto admitted = parts_.scheduler.admit(job); !admitted) {
    Outcome outcome;
    outcome.solution = unexpected(admitted.error());
    outcome.retry_delay_s = parts_.scheduler.retry_delay_s();
    job->observer->finished(std::move(outcome));
    job->observer = nullptr;
  }
  return false;
}

}  // namespace marble::server
