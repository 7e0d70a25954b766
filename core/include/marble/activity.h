// What a solve is doing at the moment, for whoever watches it from another thread: a dashboard or a progress
// bar has something to show even where no iteration ends for seconds.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <mutex>
#include <string>

namespace marble {

/// The part of a solve that is under way.
enum class Phase {
  setup,         ///< scaling, ordering, symbolic analysis, assembly
  path,          ///< the path of the relaxed problem, or the interior point method of a QP
  local_search,  ///< exact solutions of branches, and the search for better ones
  starts,        ///< further starts (option starts, or a small problem that is not convex)
  tree,          ///< branch and bound over the pairs (option global, or a small problem)
  feasibility,   ///< the search for a feasible branch, whatever the objective
  scenarios,     ///< the levels of a scenario solve
  coupled,       ///< the iterations of a coupled solve
};

/// "setup", "path", "local_search", "starts", "tree", "feasibility", "scenarios", "coupled".
[[nodiscard]] const char* to_string(Phase phase);

struct Activity {
  Phase phase = Phase::setup;
  /// Parts of the phase that are done: starts, nodes bounded, scenarios of the level before, iterations of a
  /// coupled solve; 0 in the others.
  std::int64_t done = 0;
  std::int64_t total = 0;  ///< of so many; 0 where nobody knows
  /// Objective of the best feasible point of this solve so far, user units; +∞ while there is none.
  double incumbent = std::numeric_limits<double>::infinity();
  double gap = std::numeric_limits<double>::infinity();  ///< as Solution::gap so far, of a tree

  friend bool operator==(const Activity&, const Activity&) = default;
};

/// As a person reads it: "further starts: 3 of 16, best 12.5"; "branch and bound: 120 nodes, gap 1.3e-02".
[[nodiscard]] std::string describe(const Activity& activity);

/// Where a solve writes its activity and any thread reads it. Costs a solve a few writes for each start or
/// round of nodes, and changes no bit of its answer.
class ActivityMonitor {
 public:
  [[nodiscard]] Activity read() const;
  /// Grows with every change.
  [[nodiscard]] std::int64_t changes() const { return changes_.load(std::memory_order_acquire); }

  /// A solve begins: nothing is known of it.
  void begin();
  /// Phases may lie within each other; the outermost one is shown.
  void enter(Phase phase, std::int64_t total);
  void leave();
  /// Counts only while that phase is shown.
  void set_done(Phase phase, std::int64_t done, std::int64_t total);
  /// Of a feasible point; the least one is shown.
  void add_incumbent(double objective);
  void set_gap(double gap);
  /// All of it, as another process tells it.
  void set(const Activity& activity);

 private:
  void changed() { changes_.fetch_add(1, std::memory_order_release); }

  mutable std::mutex mutex_;
  std::atomic<std::int64_t> changes_ = 0;
  Activity activity_;
  int depth_ = 0;
};

/// A phase, while it lives; without a monitor nothing.
class PhaseScope {
 public:
  PhaseScope(ActivityMonitor* monitor, Phase phase, std::int64_t total = 0) : monitor_(monitor) {
    if (monitor_ != nullptr) monitor_->enter(phase, total);
  }
  PhaseScope(const PhaseScope&) = delete;
  PhaseScope& operator=(const PhaseScope&) = delete;
  ~PhaseScope() {
    if (monitor_ != nullptr) monitor_->leave();
  }

 private:
  ActivityMonitor* monitor_;
};

}  // namespace marble
