// Begins a solve that goes on by itself.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <memory>
#include <mutex>

#include "connection.h"
#include "marble/options.h"
#include "marble/pending_solution.h"
#include "marble/problem.h"
#include "marble/solver.h"

namespace marble {

/// What a handle waits for; its heirs know who solves. They must be over when they are destroyed.
struct PendingSolution::State {
  virtual ~State() = default;
  /// Asks for the end. Thread-safe.
  virtual void cancel() = 0;
  /// The answer, once it is over; called once.
  [[nodiscard]] virtual Expected<RemoteSolution> answer() = 0;

  [[nodiscard]] bool wait(std::chrono::duration<double> longest) {
    constexpr std::chrono::duration<double> kLongest{1e8};  // the clock's own range ends
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::min(longest, kLongest), [&] { return over_; });
  }

  void wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return over_; });
  }

  bool taken = false;

 protected:
  void end() {
    const std::lock_guard lock(mutex_);
    over_ = true;
    changed_.notify_all();  // under the lock: whoever waited may delete this next
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool over_ = false;
};

namespace client {

/// Errors: those of make_request and of the trace.
[[nodiscard]] Expected<PendingSolution> begin_solve(const std::shared_ptr<const Connection>& connection,
                                                    const ProblemView& problem, const Options& options,
                                                    const SolveControls& controls, const CallControls& call);

/// The same in this process. Errors: those of Problem::create and Solver::create, which it does not put off.
[[nodiscard]] Expected<PendingSolution> begin_solve_here(const ProblemView& problem, const Options& options,
                                                         const SolveControls& controls,
                                                         const CallControls& call);

}  // namespace client
}  // namespace marble
