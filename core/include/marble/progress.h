// What a solve reports while it runs, and how it yields to other work.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <mutex>
#include <span>
#include <string>
#include <string_view>

namespace marble {

/// Largest violations in the user's own (unscaled) units; 0 if there is no such constraint.
struct Violations {
  double equality = 0.0;         ///< max |A z + b|
  double inequality = 0.0;       ///< max(0, −(C z + d))
  double complementarity = 0.0;  ///< max over pairs of |min(s, t)| with s = L z + l, t = R z + r
};

/// One row of the iteration table.
struct Progress {
  std::int32_t iteration = 0;        ///< Newton steps taken so far
  std::int32_t outer_iteration = 0;  ///< changes of κ, ρ or the multiplier estimates so far
  double objective = 0.0;            ///< ½ zᵀQz + gᵀz + c₀ at the iterate
  Violations violations = {};        ///< of the iterate, user units
  double kkt_residual = 0.0;  ///< ∞-norm of the residual (13) of the scaled problem; 0 in a local search
  double kappa = 0.0;  ///< relaxation parameter κ; 0 in a local search, whose rows are its accepted moves
  double rho = 0.0;    ///< penalty ρ
  double step_length = 0.0;         ///< accepted step length in (0, 1]; 0 before the first step
  double regularization = 0.0;      ///< δ of the factorization that gave the step
  std::int32_t factorizations = 0;  ///< all factorizations so far, rejected ones included
  double elapsed_s = 0.0;           ///< seconds since the solve began
  /// With option global_search, once its tree has begun: objective of the best point so far; +∞ if there is
  /// none.
  double incumbent = std::numeric_limits<double>::infinity();
  double bound = -std::numeric_limits<double>::infinity();  ///< as Solution::bound, so far
  double gap = std::numeric_limits<double>::infinity();     ///< as Solution::gap, so far
  std::int64_t nodes = 0;                                   ///< nodes bounded so far; 0 before a tree
  std::int64_t open_nodes = 0;     ///< nodes of the tree that are still to be bounded or branched
  std::int32_t stage = 0;          ///< stage of a scenario solve, from 0
  std::int64_t scenarios = 0;      ///< scenarios of that stage; 0 in other solves
  std::span<const double> z = {};  ///< the iterate (n, unscaled); valid only during the call
  std::span<const double> s = {};  ///< L z + l (n_c, unscaled), if the sink wants it; valid as long as z
  std::span<const double> t = {};  ///< R z + r, likewise
};

/// Returns a copy of the row that can be kept: without the borrowed vectors.
[[nodiscard]] inline Progress without_vectors(Progress progress) {
  progress.z = progress.s = progress.t = {};
  return progress;
}

/// Receives progress on the solving thread; must return quickly and must not throw.
class ProgressSink {
 public:
  virtual ~ProgressSink() = default;
  /// Called with one row after every iteration.
  virtual void report(const Progress& progress) = 0;
  /// True if rows must contain the two sides of the pairs.
  [[nodiscard]] virtual bool wants_pairs() const { return false; }
};

// The current activity of a solve, for observers on other threads: dashboards and progress bars have
// something to show even if no iteration ends for seconds.
/// The current part of a solve.
enum class Phase {
  setup,         ///< scaling, ordering, symbolic analysis, assembly
  path,          ///< the path of the relaxed problem, or the interior point method of a QP
  local_search,  ///< exact solutions of branches, and the search for better ones
  starts,        ///< further starts (option num_starts, or a small problem that is not convex)
  tree,          ///< branch and bound over the pairs (option global_search, or a small problem)
  feasibility,   ///< the search for a feasible branch, without regard to the objective
  scenarios,     ///< the stages of a scenario solve
  coupled,       ///< the iterations of a coupled solve
  conflict,      ///< the conflict of an infeasible problem (option explain)
};

/// "setup", "path", "local_search", "starts", "tree", "feasibility", "scenarios", "coupled", "conflict".
[[nodiscard]] const char* to_string(Phase phase);

/// The current activity of a solve.
struct Activity {
  Phase phase = Phase::setup;  ///< the current part
  /// Completed parts of the phase: starts, bounded nodes, scenarios of the last stage, iterations of a
  /// coupled solve, segments of a long problem (in local_search), parts that a conflict is known to need; 0
  /// in the other phases.
  std::int64_t done = 0;
  std::int64_t total = 0;  ///< the number of parts in all; 0 if unknown
  /// Objective of the best feasible point of this solve so far, user units; +∞ if there is none.
  double incumbent = std::numeric_limits<double>::infinity();
  double gap = std::numeric_limits<double>::infinity();  ///< as Solution::gap so far, for a tree

  friend bool operator==(const Activity&, const Activity&) = default;
};

/// Returns a text for users: "further starts: 3 of 16, best 12.5"; "branch and bound: 120 nodes, gap
/// 1.3e-02".
[[nodiscard]] std::string describe(const Activity& activity);

/// Holds the activity of a solve, which any thread may read. It costs a solve a few writes for each start or
/// round of nodes, and changes no bit of its solution.
class ActivityMonitor {
 public:
  /// Returns the current activity.
  [[nodiscard]] Activity read() const;
  /// Increases with every change.
  [[nodiscard]] std::int64_t changes() const { return changes_.load(std::memory_order_acquire); }

  /// Resets the activity at the beginning of a solve.
  void begin();
  /// Enters a phase. Phases may be nested; the outermost one is shown.
  void enter(Phase phase, std::int64_t total);
  /// Leaves the phase that was entered last.
  void leave();
  /// Has an effect only while that phase is shown.
  void set_done(Phase phase, std::int64_t done, std::int64_t total);
  /// Adds the objective of a feasible point; the smallest one is shown.
  void add_incumbent(double objective);
  /// Sets the gap of a tree.
  void set_gap(double gap);
  /// Sets everything, as reported by another process.
  void set(const Activity& activity);

 private:
  void changed() { changes_.fetch_add(1, std::memory_order_release); }

  mutable std::mutex mutex_;
  std::atomic<std::int64_t> changes_ = 0;
  Activity activity_;
  int depth_ = 0;
};

/// Enters a phase for its own lifetime; does nothing without a monitor.
class PhaseScope {
 public:
  /// The monitor may be null. `total` is the number of parts, 0 if unknown.
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

/// Called by a solve about once per millisecond, where it also checks its stop token: on its own thread and
/// on those of a TaskRunner that work for it. They hold no lock then.
class Pause {
 public:
  virtual ~Pause() = default;
  /// May do other work of any length before it returns. The solve then continues with the same bits.
  virtual void look() = 0;
  /// Returns how long the solve itself has been in look() so far. Time limits and times exclude this.
  [[nodiscard]] virtual std::chrono::steady_clock::duration paused() const = 0;
};

// CSV: the same columns in the same order wherever a trace is written or read.

/// One column of a trace.
struct ProgressColumn {
  std::string_view name;                               ///< as in the header line
  bool integer = false;                                ///< whether its numbers are integers
  double (*get)(const Progress& row) = nullptr;        ///< reads it from a row
  void (*set)(Progress& row, double value) = nullptr;  ///< writes it to a row
};

/// All columns in their order: iteration, outer_iteration, objective, equality_violation,
/// inequality_violation, complementarity_violation, kkt_residual, kappa, rho, step_length, regularization,
/// factorizations, elapsed_s, incumbent, bound, gap, nodes, open_nodes. Violations are in the user's units.
[[nodiscard]] std::span<const ProgressColumn> progress_columns();

/// Older traces, without columns for trees, end with elapsed_s.
inline constexpr std::size_t kColumnsBeforeTrees = 13;

/// Returns the names, separated by commas, without a line break.
[[nodiscard]] std::string progress_csv_header();

/// Appends the row's numbers, separated by commas, without a line break. Writes the shortest text that keeps
/// every bit, in any locale; numbers that are not finite are nan, inf or -inf.
void append_progress_csv(const Progress& row, std::string& text);

}  // namespace marble
