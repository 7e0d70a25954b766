#include "run.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <memory>
#include <optional>
#include <random>
#include <stop_token>
#include <vector>

#include "lanes.h"
#include "machine.h"
#include "mutex.h"
#include "plan.h"
#include "reply.h"

namespace marble::load {

// Decides what is sent when, in both loops, and tracks requests in progress.
class Dispatcher {
 public:
  /// `begin` is the start of the warm-up.
  Dispatcher(const Plan& plan, const std::vector<LoadedEntry>& entries, Clock::time_point begin);

  /// Sends until the end of the duration or the count, or a stop. Returns when the last request was sent.
  void run(const Lanes& lanes, const std::stop_token& stop);
  /// Marks a request as done: in a closed loop its client sends the next one from here.
  void done(const Lanes& lanes, const Work& work);
  /// Returns false if requests are still unanswered after that time, or on a stop.
  [[nodiscard]] bool wait_for_answers(double patience_s, const std::stop_token& stop);

  [[nodiscard]] Clock::time_point measured_from() const { return measured_from_; }
  [[nodiscard]] std::uint64_t sent() const { return sent_; }  ///< measured requests
  [[nodiscard]] bool reached_limit() const { return reached_limit_; }

 private:
  void run_open(const Lanes& lanes, const std::stop_token& stop);
  void run_closed(const Lanes& lanes, const std::stop_token& stop);
  void next_of_client(const Lanes& lanes, std::size_t client);
  [[nodiscard]] Work make_work(std::mt19937_64& engine, std::size_t client, Clock::time_point intended);
  [[nodiscard]] bool over(Clock::time_point at) const;
  [[nodiscard]] bool claim(const Work& work);  // false: the count is reached
  void send(const Lanes& lanes, Work& work);
  [[nodiscard]] bool sleep_until(Clock::time_point at, const std::stop_token& stop);

  const Plan& plan_;
  const std::vector<LoadedEntry>& entries_;
  const Clock::time_point begin_, measured_from_, end_;
  std::vector<double> shares_;  // cumulative shares of the entries; the last is 1
  std::unique_ptr<std::atomic<std::size_t>[]> next_variant_;
  std::vector<std::mt19937_64> engines_;  // one per client; each is used by one thread at a time

  std::atomic<std::uint64_t> sent_ = 0;
  std::atomic<bool> stopping_ = false, reached_limit_ = false;
  Mutex mutex_;
  std::condition_variable_any changed_;
  std::uint64_t under_way_ ABSL_GUARDED_BY(mutex_) = 0;
  int active_clients_ ABSL_GUARDED_BY(mutex_) = 0;
};

namespace {

Clock::duration duration_of(double seconds) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * std::min(seconds, 1e9)));
}

}  // namespace

Dispatcher::Dispatcher(const Plan& plan, const std::vector<LoadedEntry>& entries, Clock::time_point begin)
    : plan_(plan),
      entries_(entries),
      begin_(begin),
      measured_from_(begin + duration_of(plan.warm_up_s)),
      end_(plan.count > 0 ? Clock::time_point::max() : measured_from_ + duration_of(plan.duration_s)),
      next_variant_(std::make_unique<std::atomic<std::size_t>[]>(entries.size())) {
  double sum = 0.0;
  for (const LoadedEntry& entry : entries) shares_.push_back(sum += entry.entry.weight);
  for (double& share : shares_) share /= sum;
  for (int client = 0; client < plan.clients; ++client)
    engines_.emplace_back(plan.seed + 1000 * (1 + static_cast<std::uint64_t>(client)));
}

void Dispatcher::run(const Lanes& lanes, const std::stop_token& stop) {
  if (plan_.loop == Loop::open) {
    run_open(lanes, stop);
  } else {
    run_closed(lanes, stop);
  }
}

bool Dispatcher::over(Clock::time_point at) const {
  return stopping_ || at >= end_ || (plan_.count > 0 && sent_ >= plan_.count);
}

bool Dispatcher::claim(const Work& work) {
  if (!work.measured) return true;
  if (sent_.fetch_add(1) < plan_.count || plan_.count == 0) return true;
  --sent_;
  return false;
}

Work Dispatcher::make_work(std::mt19937_64& engine, std::size_t client, Clock::time_point intended) {
  Work work;
  const double choice = uniform(engine);
  while (work.entry + 1 < shares_.size() && choice >= shares_[work.entry]) ++work.entry;
  work.variant = next_variant_[work.entry]++ % entries_[work.entry].problems.size();
  work.client = client;
  work.intended = intended;
  work.measured = intended >= measured_from_;
  work.checked = uniform(engine) < plan_.check;
  return work;
}

void Dispatcher::send(const Lanes& lanes, Work& work) {
  work.sent = Clock::now();
  lanes.send(work);
}

bool Dispatcher::sleep_until(Clock::time_point at, const std::stop_token& stop) {
  // A condition variable wakes about 50 µs late, and a sleep is no better: good enough compared with a solve,
  // and reported as lag.
  const MutexLock lock(mutex_);
  while (!stop.stop_requested() && Clock::now() < at)
    changed_.wait_until(mutex_, stop, at, [&] { return Clock::now() >= at; });
  return !stop.stop_requested();
}

void Dispatcher::run_open(const Lanes& lanes, const std::stop_token& stop) {
  Arrivals arrivals(plan_.arrivals, plan_.rate_per_s, plan_.seed);
  std::size_t client = 0;
  while (true) {
    const Clock::time_point intended = begin_ + arrivals.next();
    if (over(intended) || !sleep_until(intended, stop)) return;
    Work work = make_work(engines_.front(), client++ % engines_.size(), intended);
    if (!claim(work)) return;
    {
      const MutexLock lock(mutex_);
      if (under_way_ >= plan_.in_flight) reached_limit_ = true;
      const auto room = [this]()
                            ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return under_way_ < plan_.in_flight; };
      if (!changed_.wait(mutex_, stop, room)) return;
      ++under_way_;
    }
    send(lanes, work);
  }
}

void Dispatcher::run_closed(const Lanes& lanes, const std::stop_token& stop) {
  {
    const MutexLock lock(mutex_);
    active_clients_ = plan_.clients;
  }
  for (int client = 0; client < plan_.clients; ++client)
    next_of_client(lanes, static_cast<std::size_t>(client));
  const MutexLock lock(mutex_);
  const auto idle = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return active_clients_ == 0; };
  if (plan_.count > 0) {
    changed_.wait(mutex_, stop, idle);
  } else {
    changed_.wait_until(mutex_, stop, end_, idle);
  }
  stopping_ = true;
}

void Dispatcher::next_of_client(const Lanes& lanes, std::size_t client) {
  thread_local bool sending = false;
  const Clock::time_point now = Clock::now();
  const auto leave = [this] {
    const MutexLock lock(mutex_);
    if (--active_clients_ == 0) changed_.notify_all();
  };
  // A request that is done while it is being sent was never sent: its client's stream has ended, and so has
  // it.
  if (sending || over(now)) return leave();
  Work work = make_work(engines_[client], client, now);
  if (!claim(work)) return leave();
  {
    const MutexLock lock(mutex_);
    ++under_way_;
  }
  sending = true;
  send(lanes, work);
  sending = false;
}

void Dispatcher::done(const Lanes& lanes, const Work& work) {
  if (plan_.loop == Loop::closed) next_of_client(lanes, work.client);
  const MutexLock lock(mutex_);
  --under_way_;
  if (under_way_ == 0 || under_way_ + 1 >= plan_.in_flight) changed_.notify_all();
}

bool Dispatcher::wait_for_answers(double patience_s, const std::stop_token& stop) {
  stopping_ = true;
  const MutexLock lock(mutex_);
  const auto all = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return under_way_ == 0; };
  return changed_.wait_for(mutex_, stop, duration_of(patience_s), all);
}

namespace {

constexpr double kLateLag_s = 1e-3;  // a smaller lag is irrelevant
constexpr double kLateShare = 0.1;   // of the median latency
constexpr double kGivenUp_s = 10.0;  // for cancelled requests to end

double seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

// Samples everything once a second.
class Log {
 public:
  Log(const RunParts& parts, Recorder& recorder, RunResult& result, Clock::time_point measured_from)
      : parts_(parts), recorder_(recorder), result_(result), from_(measured_from), thread_([this] {
          run();
        }) {}

  /// The last request was sent.
  void end() {
    {
      const MutexLock lock(mutex_);
      ending_ = true;
      changed_.notify_one();
    }
    thread_.join();
  }

 private:
  void run() {
    if (wait_until(from_)) begin();
    Clock::time_point next = from_;
    while (wait_until(next += std::chrono::seconds(1))) look();
    if (!begun_) begin();
    look();
    result_.measured_s = std::max(0.0, seconds(Clock::now() - from_));
    result_.server_cpu_s = result_.after.cpu_s - result_.before.cpu_s;
    result_.load_cpu_s = own_cpu_s() - own_cpu_before_s_;
  }
  // Returns false if the end came first.
  bool wait_until(Clock::time_point at) {
    const MutexLock lock(mutex_);
    while (!ending_ && changed_.wait_until(mutex_, at) == std::cv_status::no_timeout) {
    }
    return !ending_;
  }
  void begin() {
    begun_ = true;
    Tally early = recorder_.take();  // mostly warm-up, of which only the ends are counted
    early.ended_answers = early.ended_errors = 0;
    result_.tally.merge(early);
    own_cpu_before_s_ = own_cpu_s();
    if (auto info = parts_.server.info()) result_.before = result_.after = std::move(*info);
  }
  void look() {
    const Tally news = recorder_.take();
    Second second;
    second.at_s = seconds(Clock::now() - from_);
    second.answers = news.ended_answers;
    second.errors = news.ended_errors;
    const Histogram latency = news.sum().latency;
    second.p50_s = 1e-9 * static_cast<double>(latency.quantile(0.5));
    second.p99_s = 1e-9 * static_cast<double>(latency.quantile(0.99));
    second.most_s = 1e-9 * static_cast<double>(latency.most());
    if (auto info = parts_.server.info()) result_.after = std::move(*info);
    second.queued = result_.after.queued;
    second.running = result_.after.running;
    second.resident_bytes = result_.after.resident_bytes;
    result_.tally.merge(news);
    result_.answers_while_measured += news.ended_answers;
    result_.errors_while_measured += news.ended_errors;
    result_.seconds.push_back(second);
    if (parts_.reported) parts_.reported(second);
  }

  const RunParts& parts_;
  Recorder& recorder_;
  RunResult& result_;
  const Clock::time_point from_;
  double own_cpu_before_s_ = 0.0;
  bool begun_ = false;
  Mutex mutex_;
  Condition changed_;
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;  // declared last: it uses the others
};

}  // namespace

double RunResult::cpu_per_answer_s(double cpu_s) const {
  return answers_while_measured == 0 ? 0.0 : cpu_s / static_cast<double>(answers_while_measured);
}

std::uint64_t RunResult::failures() const {
  return tally.sum().error_count() + check.wrong_count() + abandoned;
}

// Uses results that arrive during the measurement, of requests sent before or during it.
double OverloadStep::useful() const {
  const Histogram run = result.tally.sum().run;
  const double busy_s = result.after.busy_s - result.before.busy_s;
  return busy_s > 0.0 ? 1e-9 * run.mean() * static_cast<double>(run.count()) / busy_s : 0.0;
}

Expected<RunResult> run(const RunParts& parts, const Plan& plan, const std::stop_token& stop) {
  RunResult result;
  result.plan = plan;
  result.tally = Tally(parts.entries.size());
  Recorder recorder(parts.entries.size());
  AnswerCheck check(parts.entries);
  std::optional<Dispatcher> dispatcher;
  std::optional<Lanes> lanes;
  std::atomic<bool> giving_up = false;
  std::atomic<std::uint64_t> abandoned = 0;
  const Done done = [&](const Work& work, Reply&& reply) {
    const Clock::time_point now = Clock::now();
    if (reply.error.empty() && reply.solution.status() == v1::STATUS_UNSPECIFIED)
      reply = broken_reply("the answer has no status");
    if (giving_up && !reply.error.empty()) {
      abandoned += work.measured ? 1 : 0;
    } else {
      recorder.add(work, reply, now);
      if (work.checked && work.measured && reply.error.empty()) check.add(work, std::move(reply.solution));
    }
    dispatcher->done(*lanes, work);
  };

  MARBLE_ASSIGN_OR_RETURN(auto opened, Lanes::open(parts.target, parts.entries, plan, done));
  lanes.emplace(std::move(opened));
  dispatcher.emplace(plan, parts.entries, Clock::now());
  {
    Log log(parts, recorder, result, dispatcher->measured_from());
    dispatcher->run(*lanes, stop);
    log.end();
  }
  if (!dispatcher->wait_for_answers(stop.stop_requested() ? 0.0 : plan.patience_s, stop)) {
    giving_up = true;
    lanes->cancel();
    static_cast<void>(dispatcher->wait_for_answers(kGivenUp_s, {}));
  }
  lanes.reset();
  result.tally.merge(recorder.take());
  result.check = check.finish();
  result.load_cpu_s = std::max(0.0, result.load_cpu_s - result.check.cpu_s);
  result.sent = dispatcher->sent();
  result.abandoned = abandoned;
  result.in_flight_limit = dispatcher->reached_limit();
  result.ending = stop.stop_requested() ? Ending::interrupted : Ending::complete;
  if (result.measured_s > 0.0)
    result.answers_per_s = static_cast<double>(result.answers_while_measured) / result.measured_s;
  const double lag_s = 1e-9 * static_cast<double>(result.tally.lag.quantile(0.99));
  const double median_s = 1e-9 * static_cast<double>(result.tally.sum().latency.quantile(0.5));
  result.lagged = lag_s > std::max(kLateLag_s, kLateShare * median_s);
  if (auto info = parts.server.info()) result.after = std::move(*info);
  return result;
}

}  // namespace marble::load
