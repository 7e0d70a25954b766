// Checks solutions from the problem's own data, with code that the solver does not share: a fast wrong
// solution is an error.
#pragma once

#include <atomic>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <thread>

#include "marble/options.h"
#include "mutex.h"
#include "work.h"
#include "workload.h"

namespace marble::load {

/// Returns the fault of a solution, or nothing. A "solved" one must be feasible to its tolerances, one solved
/// to reduced accuracy to 100 times these, and its multipliers must make it stationary to 1e-4 of the largest
/// term. Every solution must have the objective that it reports, and as many numbers as the problem.
[[nodiscard]] std::optional<std::string> fault_of(const OwnedProblem& problem, const Options& options,
                                                  const Solution& answer);

/// Checks on a separate thread with the lowest priority. Solutions that exceed its rate are dropped and
/// counted.
class AnswerCheck {
 public:
  explicit AnswerCheck(const std::vector<LoadedEntry>& entries);
  ~AnswerCheck();
  AnswerCheck(const AnswerCheck&) = delete;
  AnswerCheck& operator=(const AnswerCheck&) = delete;

  void add(const Work& work, v1::Solution&& answer);

  struct Findings {
    std::uint64_t checked = 0, let_go = 0;
    std::map<std::string, std::uint64_t> wrong;  ///< by entry
    std::string first_fault;                     ///< the fault of the first of them
    double cpu_s = 0.0;
    [[nodiscard]] std::uint64_t wrong_count() const;
  };
  /// Checks the rest, and ends.
  [[nodiscard]] Findings finish();

 private:
  struct Item {
    Work work;
    v1::Solution answer;
  };
  void run();
  [[nodiscard]] std::optional<Item> next();  // waits for one; nothing once all are checked
  void judge(const Item& item);

  const std::vector<LoadedEntry>& entries_;
  Mutex mutex_;
  Condition changed_;
  std::deque<Item> items_ ABSL_GUARDED_BY(mutex_);
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;
  Findings findings_ ABSL_GUARDED_BY(mutex_);
  std::thread thread_;  // declared last: it uses the others
};

}  // namespace marble::load
