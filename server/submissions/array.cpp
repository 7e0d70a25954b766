#include "submissions/array.h"

#include <algorithm>
#include <utility>

#include "base/status.h"
#include "base/wire.h"
#include "jobs/job_log.h"
#include "jobs/unix_time.h"
#include "marble/convert.h"
#include "process/fault_point.h"
#include "service/job_message.h"
#include "service/reply.h"
#include "service/stored_job.h"

namespace marble::server {
namespace {

constexpr std::size_t kAhead = 2;               // elements in the queue besides those that run
constexpr std::int64_t kAnswerBytes = 128;      // memory of a result besides its message
constexpr std::int64_t kNewestBytes = 1 << 20;  // bytes of the newest results that stay in memory
constexpr std::size_t kNewest = 64;             // number of them

Error deleted(const std::string& id) {
  return failure(ErrorCode::not_found, "job_id", id, "was deleted, and its answers with it");
}

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
      store_(store),
      one_suspect_(suspects),
      record_(std::move(start.record)),
      setup_(std::move(start.setup)),
      most_running_(static_cast<std::size_t>(parts.scheduler.limits().workers) + kAhead),
      place_(std::move(start.place)),
      counts_(start.counts),
      last_sequence_(start.last_sequence),
      answer_bytes_(start.answer_bytes),
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

// Elements during which too many servers died end without another start.
void Array::set_aside_lost() {
  std::vector<OpenElement> aside;
  {
    const MutexLock lock(mutex_);
    if (end_) return;
    const auto first = std::stable_partition(suspects_.begin(), suspects_.end(), [&](const OpenElement& one) {
      return one.lost < parts_.config.job_starts;
    });
    aside.assign(first, suspects_.end());
    suspects_.erase(first, suspects_.end());
    unsettled_ += static_cast<int>(aside.size());
  }
  for (const OpenElement& element : aside) {
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
  if (end_ || stage_ != Stage::open || running_.size() >= most_running_) return nullptr;
  std::deque<OpenElement>* from = &waiting_;
  if (!suspects_.empty() && one_suspect_.enter(weak_from_this())) from = &suspects_;
  if (from->empty()) return nullptr;
  const auto run = std::make_shared<Run>(Run{from->front().index, from->front().lost, nullptr, 0});
  from->pop_front();
  running_[run->index] = nullptr;  // the element counts as running from here on
  return run;
}

void Array::feed() {
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
      is_late = end_.has_value();
    }
    if (is_late) parts_.scheduler.cancel(job);
  }
}

void Array::put_back(const Run& run) {
  {
    const MutexLock lock(mutex_);
    running_.erase(run.index);
    (run.lost > 0 ? suspects_ : waiting_).push_front({run.index, run.lost});
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
  ElementAnswer answer = answer_of(run, outcome);
  {
    const MutexLock lock(mutex_);
    if (place_ != nullptr) place_->remove_bytes(run.bytes);
    running_.erase(run.index);
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
  const auto size = static_cast<std::int64_t>(answer.message.size()) + kAnswerBytes;
  if (!parts_.results.grow(description().id, size) && answer.end != ElementEnd::failed) {
    answer = error_of(answer.index, no_room(element_id(description().id, answer.index)));
    give_up(no_room(description().id));
  }
  fault_point("before_answer");
  ElementAnswer given = answer;
  store_.answer_element(
      std::move(given), [self = shared_from_this(), answer = std::move(answer)](const Expected<void>& made) {
        if (made) return self->kept(answer);
        if (made.error().code == ErrorCode::resource_exhausted)
          return self->keep(self->error_of(answer.index, made.error()));
        const MutexLock lock(self->mutex_);  // the store is closed: the element runs again after the restart
        --self->unsettled_;
        self->waiting_.push_back({answer.index, 0});
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
    if (store_.is_durable()) {  // a durable store reports them in the order of their numbers
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
  give_up(failure(ErrorCode::cancelled, "given up before all its elements had an answer"));
}

void Array::forgotten() {
  {
    const MutexLock lock(mutex_);
    is_gone_ = true;
    newest_.clear();
  }
  give_up(deleted(description().id));
  report();
}

void Array::give_up(const Error& reason) {
  std::vector<std::shared_ptr<Job>> jobs;
  {
    const MutexLock lock(mutex_);
    if (end_ || stage_ != Stage::open) return;
    end_ = reason;
    for (const auto& [index, job] : running_) {
      if (job != nullptr) jobs.push_back(job);
    }
  }
  for (const auto& job : jobs) parts_.scheduler.cancel(job);
  end_if_over();
}

void Array::end_if_over() {
  std::optional<Error> reason;
  {
    const MutexLock lock(mutex_);
    const bool waits = !end_ && (!waiting_.empty() || !suspects_.empty());
    if (stage_ != Stage::open || waits || !running_.empty() || unsettled_ > 0) return;
    stage_ = Stage::ending;
    if (!waiting_.empty() || !suspects_.empty()) reason = end_;
    end_ = reason;  // a reason after the last element changes nothing
  }
  end(reason);
}

void Array::end(const std::optional<Error>& reason) {
  const JobDescription& what = description();
  const auto age = std::chrono::system_clock::now() - what.accepted;
  record_->array_ended(reason, std::max(0.0, std::chrono::duration<double>(age).count()));
  parts_.board.finish(record_);
  log_array_end(parts_.log, *record_, reason);
  std::shared_ptr<Scheduler::Place> place;  // its end notifies others
  {
    const MutexLock lock(mutex_);
    place.swap(place_);
    setup_ = nullptr;  // nothing runs any more
    waiting_.clear();
    suspects_.clear();
  }
  place = nullptr;
  StoredResult stored{.id = what.id};
  v1::GetJobResponse job;
  to_message(*record_, &job);
  stored.job = job.SerializeAsString();
  stored.info = job.job().SerializeAsString();
  stored.finished_unix_s = job.job().finished_unix_s();
  if (reason) stored.error = to_message(*reason).SerializeAsString();
  store_.finish(std::move(stored), [self = shared_from_this()](const Expected<void>& /*made*/) {
    self->parts_.results.put(self->description().id, no_single_answer(self->description().id), Clock::now());
    {
      const MutexLock lock(self->mutex_);
      self->stage_ = Stage::over;
      self->newest_.clear();
    }
    self->report();
  });
}

Expected<Array::News> Array::news_after(std::int64_t sequence, std::int64_t most_bytes) {
  News news;
  {
    const MutexLock lock(mutex_);
    if (is_gone_) return unexpected(deleted(description().id));
    news.is_over = stage_ == Stage::over && sequence >= last_sequence_;
    if (news.is_over) news.end = end_;
    if (sequence >= last_sequence_) return news;
    if (!newest_.empty() && newest_.front().sequence <= sequence + 1) {
      const auto first = newest_.begin() + (sequence + 1 - newest_.front().sequence);
      news.answers.assign(first, newest_.end());
      return news;
    }
  }
  auto answers = store_.answers_after(description().id, sequence, most_bytes);
  if (!answers) return unexpected(answers.error());
  news.answers = std::move(*answers);
  if (news.answers.empty())
    return unexpected(failure(ErrorCode::internal, "an answer of the array cannot be read any more"));
  return news;
}

std::int64_t Array::elements() const {
  const MutexLock lock(mutex_);
  return counts_.elements;
}

void Array::listen(const std::weak_ptr<ArrayListener>& listener) {
  const MutexLock lock(mutex_);
  std::erase_if(listeners_, [](const auto& one) { return one.expired(); });
  listeners_.push_back(listener);
}

void Array::report() {
  std::vector<std::shared_ptr<ArrayListener>> all;
  {
    const MutexLock lock(mutex_);
    for (const auto& weak : listeners_) {
      if (auto listener = weak.lock()) all.push_back(std::move(listener));
    }
  }
  for (const auto& listener : all) listener->news();
}

}  // namespace marble::server
