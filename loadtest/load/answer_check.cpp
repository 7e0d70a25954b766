#include "answer_check.h"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <sstream>

#include "marble/convert.h"
#include "support/independent_check.h"

namespace marble::load {
namespace {

constexpr std::size_t kMostWaiting = 256;
constexpr double kReducedAccuracy = 100.0;
constexpr double kStationarity = 1e-4;
constexpr double kObjective = 1e-8;  // allows two ways to sum the same terms
constexpr double kRounding = 1e-9;   // beyond a tolerance: allows two ways to compute a violation

std::string reported(const char* what, double value, double most) {
  std::ostringstream text;
  text << what << " " << value << ", more than " << most;
  return text.str();
}

std::optional<std::string> size_fault(const OwnedProblem& p, const Solution& a) {
  const auto wrong = [](std::size_t is, std::size_t should) { return is != should; };
  if (wrong(a.z.size(), p.g.size()) || wrong(a.equality_multipliers.size(), p.b.size()) ||
      wrong(a.inequality_multipliers.size(), p.d.size()) ||
      wrong(a.complementarity_multipliers_L.size(), p.l.size()) ||
      wrong(a.complementarity_multipliers_R.size(), p.r.size()))
    return "its vectors have not the sizes of the problem";
  return std::nullopt;
}

}  // namespace

std::optional<std::string> fault_of(const OwnedProblem& problem, const Options& options,
                                    const Solution& answer) {
  if (auto fault = size_fault(problem, answer)) return fault;
  const testing::Verdict verdict = testing::judge(problem.view(), answer);
  const double objective_error = std::abs(verdict.objective - answer.objective);
  const double objective_most = kObjective * (1.0 + std::abs(verdict.objective));
  if (!(objective_error <= objective_most))
    return reported("objective off by", objective_error, objective_most);
  if (!is_solved(answer.status)) return std::nullopt;
  const double accuracy = answer.status == Status::solved ? 1.0 : kReducedAccuracy;
  const auto beyond = [&](double value, double tolerance) {
    return !(value <= accuracy * tolerance + kRounding);
  };
  if (beyond(verdict.equality, options.equality_tolerance))
    return reported("equality violated by", verdict.equality, options.equality_tolerance);
  if (beyond(verdict.inequality, options.inequality_tolerance))
    return reported("inequality violated by", verdict.inequality, options.inequality_tolerance);
  if (beyond(verdict.complementarity, options.complementarity_tolerance))
    return reported("complementarity violated by", verdict.complementarity,
                    options.complementarity_tolerance);
  if (!(verdict.stationarity <= kStationarity * accuracy))
    return reported("not stationary by", verdict.stationarity, kStationarity);
  return std::nullopt;
}

std::uint64_t AnswerCheck::Findings::wrong_count() const {
  std::uint64_t count = 0;
  for (const auto& [entry, times] : wrong) count += times;
  return count;
}

AnswerCheck::AnswerCheck(const std::vector<LoadedEntry>& entries)
    : entries_(entries), thread_([this] { run(); }) {}

AnswerCheck::~AnswerCheck() {
  if (thread_.joinable()) static_cast<void>(finish());
}

void AnswerCheck::add(const Work& work, v1::Solution&& answer) {
  const MutexLock lock(mutex_);
  if (items_.size() >= kMostWaiting) {
    ++findings_.let_go;
    return;
  }
  items_.push_back({work, std::move(answer)});
  changed_.notify_one();
}

AnswerCheck::Findings AnswerCheck::finish() {
  {
    const MutexLock lock(mutex_);
    ending_ = true;
    changed_.notify_one();
  }
  thread_.join();
  const MutexLock lock(mutex_);
  return findings_;
}

void AnswerCheck::run() {
  setpriority(PRIO_PROCESS, 0, 19);  // for this thread alone, on Linux
  while (const std::optional<Item> item = next()) judge(*item);
  timespec used = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  const MutexLock lock(mutex_);
  findings_.cpu_s = static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

std::optional<AnswerCheck::Item> AnswerCheck::next() {
  const MutexLock lock(mutex_);
  while (!ending_ && items_.empty()) changed_.wait(mutex_);
  if (items_.empty()) return std::nullopt;
  Item item = std::move(items_.front());
  items_.pop_front();
  return item;
}

void AnswerCheck::judge(const Item& item) {
  const LoadedEntry& loaded = entries_[item.work.entry];
  const auto fault =
      fault_of(loaded.problems[item.work.variant], loaded.entry.options, solution_of(item.answer));
  const MutexLock lock(mutex_);
  ++findings_.checked;
  if (!fault) return;
  ++findings_.wrong[loaded.entry.name];
  if (findings_.first_fault.empty()) findings_.first_fault = loaded.entry.name + ": " + *fault;
}

}  // namespace marble::load
