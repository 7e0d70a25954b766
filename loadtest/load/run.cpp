#include "run.h"

#include <algorithm>
#include <atomic>
#include <optional>

#include "dispatcher.h"
#include "lanes.h"
#include "machine.h"
#include "mutex.h"
#include "reply.h"

namespace marble::load {
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

  auto opened = Lanes::open(parts.target, parts.entries, plan, done);
  if (!opened) return unexpected(opened.error());
  lanes.emplace(std::move(*opened));
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
