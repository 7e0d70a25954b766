// Starts a solve that runs by itself.
#pragma once

#include <algorithm>
#include <memory>

#include "connection/connection.h"
#include "marble/options.h"
#include "marble/pending_solution.h"
#include "marble/problem.h"
#include "marble/solver.h"
#include "mutex.h"

namespace marble {

/// What a handle waits for; subclasses know who solves. They must have ended when they are destroyed.
struct PendingSolution::State {
  virtual ~State() = default;
  /// Requests cancellation. Thread-safe.
  virtual void cancel() = 0;
  /// Returns the solution, once the solve has ended; called once.
  [[nodiscard]] virtual Expected<RemoteSolution> answer() = 0;

  [[nodiscard]] bool wait(std::chrono::duration<double> longest) {
    constexpr std::chrono::duration<double> kLongest{1e8};  // the range of the clock is limited
    const auto end = std::chrono::steady_clock::now() + std::min(longest, kLongest);
    const MutexLock lock(mutex_);
    while (!over_ && changed_.wait_until(mutex_, end) == std::cv_status::no_timeout) {
    }
    return over_;
  }

  void wait() {
    const MutexLock lock(mutex_);
    while (!over_) changed_.wait(mutex_);
  }

  bool taken = false;

 protected:
  void end() {
    const MutexLock lock(mutex_);
    over_ = true;
    changed_.notify_all();  // under the lock: the waiting thread may delete this next
  }

 private:
  Mutex mutex_;
  Condition changed_;
  bool over_ ABSL_GUARDED_BY(mutex_) = false;
};

namespace client {

/// Starts a remote solve. Errors: those of make_request and of the trace.
[[nodiscard]] Expected<PendingSolution> begin_solve(const std::shared_ptr<const Connection>& connection,
                                                    const ProblemView& problem, const Options& options,
                                                    const SolveControls& controls, const CallControls& call);

/// Starts a solve in this process. Errors: those of Problem::create and Solver::create, which it returns at
/// once.
[[nodiscard]] Expected<PendingSolution> begin_solve_locally(const ProblemView& problem,
                                                            const Options& options,
                                                            const SolveControls& controls,
                                                            const CallControls& call);

}  // namespace client
}  // namespace marble
