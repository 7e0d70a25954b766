#include "submissions/array.h"

#include <algorithm>
#include <utility>

#include "base/fault_point.h"
#include "base/status.h"
#include "base/wire.h"
#include "jobs/job_log.h"
#include "jobs/unix_time.h"
#include "marble/convert.h"
#include "service/job_message.h"
#include "service/reply.h"
#include "service/stored_job.h"

namespace marble::server {
namespace {

constexpr std::size_t kAhead = 2;               // elements in the queue besides those that run
constexpr std::int64_t kAnswerOverhead = 128;   // memory of a result besides its message
constexpr std::int64_t kNewestBytes = 1 << 20;  // bytes of the newest results that stay in memory
constexpr std::size_t kNewest = 64;             // number of them
constexpr double kClaimedAhead = 0.05;          // seconds of work that is claimed before it can begin
constexpr double kMostClaimedAhead = 64.0;      // and elements

Error no_room(const std::string& id) {
  return failure(
      ErrorCode::resource_exhausted, "result_bytes", id,
      "there is no room for the answers of its other elements: arrays that have not ended may have "
      "half of it");
}

int class_of(const std::string& id) { return static_cast<int>(std::hash<std::string>{}(id)&0x3fffffffU); }

}  // namespace

ResultStore::Result no_single_answer(const std::string& id) {
  return {unexpected(failure(ErrorCode::failed_precondition, "job_id", id,
                             "is an array: Jobs.ArrayResults returns its answers")),
          0.0};
}

// One start of an element.
struct Array::Run {
  std::int64_t index = 0;
  std::int64_t lost = 0;
  std::shared_ptr<JobRecord> record;
  std::int64_t bytes = 0;  // bytes of its request, once it is read
};

class Array::Keeper final : public JobObserver {
 public:
  Keeper(std::shared_ptr<Array> array, std::shared_ptr<Run> run)
      : array_(std::move(array)), run_(std::move(run)) {}
  void started(double queue_s) override {
    array_->store_.began({run_->record->id(), static_cast<int>(run_->lost) + 1});
    if (array_->record_->snapshot().state == JobState::queued) array_->record_->started(queue_s);
  }
  void finished(Outcome outcome) override {
    array_->store_.ended(run_->record->id());
    array_->ended(*run_, outcome);
    if (run_->lost > 0) array_->one_suspect_.leave();
  }

 private:
  const std::shared_ptr<Array> array_;
  const std::shared_ptr<Run> run_;
};

Array::Array(const ServiceParts& parts, ElementStore& store, OneSuspect& suspects, ArrayStart start)
    : parts_(parts),
      own_store_(std::move(start.store)),
      store_(own_store_ != nullptr ? *own_store_ : store),
      left_(std::move(start.left)),
      one_suspect_(suspects),
      record_(std::move(start.record)),
      setup_(std::move(start.setup)),
      most_running_(static_cast<std::size_t>(parts.scheduler.limits().workers) + kAhead),
      place_(std::move(start.place)),
      counts_(start.counts),
      last_sequence_(start.last_sequence),
      answer_bytes_(start.answer_bytes),
      more_(store_.is_shared()),
      more_suspects_(store_.is_shared()),
      end_(std::move(start.end)),
      stage_(start.is_over ? Stage::over : Stage::open) {
  for (const OpenElement& element : start.open) (element.lost > 0 ? suspects_ : waiting_).push_back(element);
  if (!start.is_over) record_->set_array(counts_, answer_bytes_);
}

void Array::start() {
  record_->queued();
  record_->set_cancel([weak = weak_from_this()] {
    if (const auto array = weak.lock()) array->cancel();
  });
  set_aside_lost();
  feed();
  end_if_over();
}

void Array::set_aside_lost() {
  std::vector<OpenElement> aside;
  {
    const MutexLock lock(mutex_);
    if (end_) return;
    const auto first = std::stable_partition(suspects_.begin(), suspects_.end(),
                                             [&](const OpenElement& one) { return !is_lost(one.lost); });
    aside.assign(first, suspects_.end());
    suspects_.erase(first, suspects_.end());
    unsettled_ += static_cast<int>(aside.size());
  }
  set_aside(aside);
}

bool Array::is_lost(std::int64_t lost) const { return lost > 0 && lost >= parts_.config.job_starts; }

// Elements during which too many servers died end without another start; they count as unsettled.
void Array::set_aside(const std::vector<OpenElement>& elements) {
  for (const OpenElement& element : elements) {
    const auto starts = static_cast<int>(element.lost);
    const JobDescription& what = description();
    log_set_aside(
        parts_.log,
        {.id = element_id(what.id, element.index), .client = what.client, .request_id = what.request_id},
        starts);
    keep(error_of(element.index, server::set_aside(starts)));
  }
}

std::shared_ptr<Array::Run> Array::next() {
  const MutexLock lock(mutex_);
  if (end_ || abandoned_ || stage_ != Stage::open || running_.size() >= most_running_) return nullptr;
  std::deque<OpenElement>* from = &waiting_;
  // One that was claimed has entered already.
  if (!suspects_.empty() && (store_.is_shared() || one_suspect_.enter(weak_from_this()))) from = &suspects_;
  if (from->empty()) return nullptr;
  const auto run = std::make_shared<Run>(Run{from->front().index, from->front().lost, nullptr, 0});
  from->pop_front();
  running_[run->index] = nullptr;  // the element counts as running from here on
  return run;
}

// One thread at a time, so that elements enter the queue in order; it also serves calls of other threads.
void Array::feed() {
  int calls = 1;
  {
    const MutexLock lock(mutex_);
    if (feed_calls_++ > 0) return;
  }
  while (calls > 0) {
    admit_waiting();
    const MutexLock lock(mutex_);
    feed_calls_ -= calls;
    calls = feed_calls_;
  }
  if (store_.is_shared()) claim();
}

void Array::admit_waiting() {
  while (const std::shared_ptr<Run> run = next()) {
    const std::shared_ptr<Job> job = job_of(run);
    {
      const MutexLock lock(mutex_);
      running_[run->index] = job;
    }
    if (!parts_.scheduler.admit(job)) {  // the server stops
      job->observer = nullptr;
      put_back(*run);
      if (run->lost > 0) one_suspect_.leave();
      return;
    }
    bool is_late = false;
    {
      const MutexLock lock(mutex_);
      is_late = end_.has_value() || abandoned_;
    }
    if (is_late) parts_.scheduler.cancel(job);
  }
}

// Claims as many elements as can begin now, more if they are short, and one suspect if none runs here. An
// element that is claimed when this server dies counts as one that ran.
void Array::claim() {
  bool suspect = false;
  std::int64_t most = 0;
  {
    const MutexLock lock(mutex_);
    if (end_ || stage_ != Stage::open || claiming_ || abandoned_ || parts_.scheduler.is_closed()) return;
    const int workers = parts_.scheduler.limits().workers;
    most = workers - static_cast<std::int64_t>(running_.size() + waiting_.size());
    if (mean_s_)
      most += static_cast<std::int64_t>(std::min(workers * kClaimedAhead / *mean_s_, kMostClaimedAhead));
    suspect = more_suspects_ && suspects_.empty() && one_suspect_.enter(weak_from_this());
    if (!suspect && (!more_ || most <= 0)) return;
    claiming_ = true;
  }
  store_.claim(suspect, most,
               [self = shared_from_this(), suspect](const Expected<std::vector<ClaimedElement>>& elements) {
                 self->claimed(suspect, elements);
               });
}

void Array::claimed(bool suspect, const Expected<std::vector<ClaimedElement>>& elements) {
  std::vector<OpenElement> aside;
  bool entered = suspect;
  {
    const MutexLock lock(mutex_);
    claiming_ = false;
    if (elements && elements->empty()) (suspect ? more_suspects_ : more_) = false;
    if (elements && stage_ == Stage::open) {
      for (const ClaimedElement& element : *elements) {
        if (place_ != nullptr && element.request)
          (void)place_->add_bytes(static_cast<std::int64_t>(element.request->size()));
        if (is_lost(element.lost)) {
          aside.push_back({element.index, element.lost});
        } else {
          (suspect ? suspects_ : waiting_).push_back({element.index, element.lost});
          entered = false;
        }
      }
      unsettled_ += static_cast<int>(aside.size());
    }
  }
  if (entered) one_suspect_.leave();
  set_aside(aside);
  feed();
  end_if_over();
}

void Array::put_back(const Run& run) {
  {
    const MutexLock lock(mutex_);
    running_.erase(run.index);
    if (store_.is_shared()) {
      more_ = true;  // for the next server that claims it
    } else {
      (run.lost > 0 ? suspects_ : waiting_).push_front({run.index, run.lost});
    }
  }
  end_if_over();
}

std::shared_ptr<Job> Array::job_of(const std::shared_ptr<Run>& run) {
  const JobDescription& what = description();
  run->record = parts_.board.make({.id = element_id(what.id, run->index),
                                   .kind = JobKind::array,
                                   .priority = what.priority,
                                   .client = what.client,
                                   .request_id = what.request_id,
                                   .name = what.name,
                                   .peer = what.peer,
                                   .variables = what.variables,
                                   .equalities = what.equalities,
                                   .inequalities = what.inequalities,
                                   .pairs = what.pairs,
                                   .trace = what.trace},
                                  setup_->options());
  auto job = std::make_shared<Job>();
  job->record = run->record;
  job->quota = parts_.access.quota_of(what.client);
  job->ticket = {.client = what.client,
                 .priority = what.priority,
                 .arrival = Clock::now(),
                 .work_class = class_of(what.id),
                 .placed = true};
  job->time_limit_s = setup_->options().time_limit_s;
  job->observer = std::make_shared<Keeper>(shared_from_this(), run);
  job->work = [self = shared_from_this(), run, weak = std::weak_ptr<Job>(job)](
                  const SolveControls& controls) { return self->solve(*run, weak, controls); };
  return job;
}

// The worker reads the request, so that waiting elements take no memory for it.
Expected<Solution> Array::solve(Run& run, const std::weak_ptr<Job>& job, const SolveControls& controls) {
  const JobDescription& what = description();
  fault_point("job", element_id(what.request_id, run.index));
  const auto bytes = store_.element(what.id, run.index);
  if (!bytes)
    return unexpected(
        failure(ErrorCode::internal, "the stored element cannot be read: " + bytes.error().bound));
  run.bytes = static_cast<std::int64_t>(bytes->size());
  v1::ArrayElement element;
  if (!element.ParseFromString(*bytes))
    return unexpected(failure(ErrorCode::internal, "the stored element cannot be read"));
  const auto request = setup_->request(std::move(element));
  if (!request) return unexpected(of_element(run.index, request.error()));
  (*request)->set_priority(to_message(what.priority));
  const Caller caller{.identity = {.client = what.client, .roles = {}},
                      .origin = {.peer = what.peer, .client = what.client, .request_id = what.request_id},
                      .earlier = Caller::Earlier{run.record->id(), what.accepted, run.record}};
  const auto made = make_job(parts_, caller, JobKind::array, *request);
  if (!made) return unexpected(of_element(run.index, made.error()));
  auto solved = (*made)->work(controls);
  if (const auto whole = job.lock()) whole->also = std::move((*made)->also);
  return solved;
}

void Array::ended(const Run& run, const Outcome& outcome) {
  if (outcome.interrupted && store_.is_durable()) return put_back(run);
  bool abandoned = false;
  {
    const MutexLock lock(mutex_);
    abandoned = abandoned_;
    if (abandoned) running_.erase(run.index);
  }
  if (abandoned) return end_if_over();
  ElementAnswer answer = answer_of(run, outcome);
  {
    const MutexLock lock(mutex_);
    if (place_ != nullptr) place_->remove_bytes(run.bytes);
    running_.erase(run.index);
    const double run_s = std::max(outcome.total_s - outcome.queue_s, 1e-4);
    mean_s_ = mean_s_ ? 0.8 * *mean_s_ + 0.2 * run_s : run_s;
    ++unsettled_;
  }
  keep(std::move(answer));
  feed();
}

ElementAnswer Array::answer_of(const Run& run, const Outcome& outcome) const {
  v1::ArrayResultsResponse message;
  message.set_index(run.index);
  const auto filled = fill_response(*run.record, outcome, message.mutable_result());
  if (!filled) *message.mutable_error() = to_message(filled.error(), outcome.retry_delay_s);
  ElementAnswer answer{.array = description().id, .index = run.index};
  if (!filled) answer.end = ElementEnd::failed;
  if (filled && is_solved(outcome.solution->status)) answer.end = ElementEnd::solved;
  if (filled) {
    answer.iterations = outcome.solution->iterations;
    answer.factorizations = outcome.solution->factorizations;
  }
  answer.message = message.SerializeAsString();
  return answer;
}

ElementAnswer Array::error_of(std::int64_t index, const Error& error) const {
  v1::ArrayResultsResponse message;
  message.set_index(index);
  *message.mutable_error() = to_message(error);
  return {.array = description().id,
          .index = index,
          .end = ElementEnd::failed,
          .message = message.SerializeAsString()};
}

// Keeps one result of `unsettled_`. If there is no memory for it, or the store does not accept its size, an
// error is kept instead.
void Array::keep(ElementAnswer answer) {
  const auto size = static_cast<std::int64_t>(answer.message.size()) + kAnswerOverhead;
  if (!parts_.results.grow(description().id, size) && answer.end != ElementEnd::failed) {
    answer = error_of(answer.index, no_room(element_id(description().id, answer.index)));
    stop(no_room(description().id));
  }
  fault_point("before_answer");
  ElementAnswer given = answer;
  store_.answer_element(std::move(given), [self = shared_from_this(),
                                           answer = std::move(answer)](const Expected<void>& made) {
    if (made) return self->kept(answer);
    if (made.error().code == ErrorCode::resource_exhausted)
      return self->keep(self->error_of(answer.index, made.error()));
    {
      const MutexLock lock(self->mutex_);  // the store is closed: the element runs again after the restart
      --self->unsettled_;
      self->waiting_.push_back({answer.index, 0});
    }
  });
}

void Array::kept(const ElementAnswer& answer) {
  {
    const MutexLock lock(mutex_);
    --unsettled_;
    ++counts_.done;
    if (answer.end == ElementEnd::solved) ++counts_.solved;
    if (answer.end == ElementEnd::failed) ++counts_.failed;
    counts_.iterations += answer.iterations;
    counts_.factorizations += answer.factorizations;
    const auto bytes = static_cast<std::int64_t>(answer.message.size());
    answer_bytes_ += bytes;
    ++last_sequence_;
    // A durable store reports them in the order of their numbers.
    if (store_.is_durable() && !store_.is_shared()) {
      newest_.push_back(answer);
      newest_.back().sequence = last_sequence_;
      newest_bytes_ += bytes;
      while (newest_.size() > 1 && (newest_.size() > kNewest || newest_bytes_ > kNewestBytes)) {
        newest_bytes_ -= static_cast<std::int64_t>(newest_.front().message.size());
        newest_.pop_front();
      }
    }
    if (stage_ == Stage::open) record_->set_array(counts_, answer_bytes_);
  }
  report();
  end_if_over();
}

void Array::cancel() {
  store_.cancel(description().id);
  stop(failure(ErrorCode::cancelled, "given up before all its elements had an answer"));
}

void Array::forgotten() {
  {
    const MutexLock lock(mutex_);
    is_gone_ = true;
    newest_.clear();
  }
  stop(array_deleted(description().id));
  report();
}

void Array::abandon() { stop(std::nullopt); }

// Without a reason, it is abandoned.
void Array::stop(const std::optional<Error>& reason) {
  std::vector<std::shared_ptr<Job>> jobs;
  {
    const MutexLock lock(mutex_);
    if (stage_ != Stage::open || (reason && end_)) return;
    if (reason) {
      end_ = reason;
    } else {
      abandoned_ = true;
    }
    for (const auto& [index, job] : running_) {
      if (job != nullptr) jobs.push_back(job);
    }
  }
  for (const auto& job : jobs) parts_.scheduler.cancel(job);
  end_if_over();
}

bool Array::waits() const {
  if (store_.is_shared() && counts_.done >= counts_.elements) return false;
  return more_ || more_suspects_ || claiming_ || !waiting_.empty() || !suspects_.empty();
}

void Array::end_if_over() {
  std::optional<Error> reason;
  bool leaves = false;
  {
    const MutexLock lock(mutex_);
    if (stage_ != Stage::open || !running_.empty() || unsettled_ > 0) return;
    leaves =
        abandoned_ || (!end_ && store_.is_shared() && waits() && !claiming_ && parts_.scheduler.is_closed());
    if (!leaves && !end_ && waits()) return;
    stage_ = leaves ? Stage::over : Stage::ending;
    if (waits()) reason = end_;
    end_ = reason;  // a reason after the last element changes nothing
  }
  if (!leaves) return end(reason);
  release();  // another server continues it
  if (left_) left_();
}

// Nothing runs any more.
void Array::release() {
  std::shared_ptr<Scheduler::Place> place;  // its end notifies others
  bool unused = false;                      // a suspect was claimed, and does not run
  {
    const MutexLock lock(mutex_);
    place.swap(place_);
    setup_ = nullptr;
    unused = store_.is_shared() && !suspects_.empty();
    waiting_.clear();
    suspects_.clear();
  }
  place = nullptr;
  if (unused) one_suspect_.leave();
}

void Array::end(const std::optional<Error>& reason) {
  const JobDescription& what = description();
  const auto age = std::chrono::system_clock::now() - what.accepted;
  record_->array_ended(reason, std::max(0.0, std::chrono::duration<double>(age).count()));
  parts_.board.finish(record_);
  log_array_end(parts_.log, *record_, reason);
  release();
  StoredResult stored{.id = what.id, .element_bytes = answer_bytes()};
  v1::GetJobResponse job;
  to_message(*record_, &job);
  stored.job = job.SerializeAsString();
  stored.info = job.job().SerializeAsString();
  stored.finished_unix_s = job.job().finished_unix_s();
  if (reason) stored.error = to_message(*reason).SerializeAsString();
  store_.finish(std::move(stored), [self = shared_from_this()](const Expected<void>& /*made*/) {
    if (!self->store_.is_shared())
      self->parts_.results.put(self->description().id, no_single_answer(self->description().id),
                               Clock::now());
    {
      const MutexLock lock(self->mutex_);
      self->stage_ = Stage::over;
      self->newest_.clear();
    }
    self->report();
    if (self->left_) self->left_();
  });
}

}  // namespace marble::server
