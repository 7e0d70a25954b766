// What a solve tells while it runs, and what it asks.
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

/// Largest violations in the user's own (unscaled) units; 0 where there is no such constraint.
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
  double elapsed_s = 0.0;           ///< since the solve began, seconds
  /// Option global, once its tree has begun: objective of the best point so far, +∞ while there is none.
  double incumbent = std::numeric_limits<double>::infinity();
  double bound = -std::numeric_limits<double>::infinity();  ///< as Solution::bound, so far
  double gap = std::numeric_limits<double>::infinity();     ///< as Solution::gap, so far
  std::int64_t nodes = 0;                                   ///< bounded so far; 0 before a tree
  std::int64_t open_nodes = 0;                              ///< of the tree, still to be bounded or branched
  std::int32_t level = 0;                                   ///< of a scenario solve, from 0
  std::int64_t scenarios = 0;                               ///< of that level; 0 in other solves
  std::span<const double> z = {};  ///< the iterate (n, unscaled); valid only during the call
  std::span<const double> s = {};  ///< L z + l (n_c, unscaled), if the sink wants it; valid as z is
  std::span<const double> t = {};  ///< R z + r, the same
};

/// The same row to keep: without the vectors, which are lent.
[[nodiscard]] inline Progress without_vectors(Progress progress) {
  progress.z = progress.s = progress.t = {};
  return progress;
}

/// Receives progress on the solving thread; must return quickly and must not throw.
class ProgressSink {
 public:
  virtual ~ProgressSink() = default;
  /// One row, after every iteration.
  virtual void report(const Progress& progress) = 0;
  /// Whether rows shall carry the two sides of the pairs.
  [[nodiscard]] virtual bool wants_pairs() const { return false; }
};

// What a solve is doing at the moment, for whoever watches it from another thread: a dashboard or a progress
// bar has something to show even where no iteration ends for seconds.
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
  conflict,      ///< the conflict of an infeasible problem (option explain)
};

/// "setup", "path", "local_search", "starts", "tree", "feasibility", "scenarios", "coupled", "conflict".
[[nodiscard]] const char* to_string(Phase phase);

/// What a solve is doing at the moment.
struct Activity {
  Phase phase = Phase::setup;  ///< the part that is under way
  /// Parts of the phase that are done: starts, nodes bounded, scenarios of the level before, iterations of a
  /// coupled solve, segments of a long problem (in local_search), parts that a conflict is known to need; 0
  /// in the others.
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
  /// As it is now.
  [[nodiscard]] Activity read() const;
  /// Grows with every change.
  [[nodiscard]] std::int64_t changes() const { return changes_.load(std::memory_order_acquire); }

  /// A solve begins: nothing is known of it.
  void begin();
  /// Phases may lie within each other; the outermost one is shown.
  void enter(Phase phase, std::int64_t total);
  /// The end of the phase that was entered last.
  void leave();
  /// Counts only while that phase is shown.
  void set_done(Phase phase, std::int64_t done, std::int64_t total);
  /// Of a feasible point; the least one is shown.
  void add_incumbent(double objective);
  /// Of a tree.
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
  /// The monitor may be null; `total` parts, 0 where nobody knows.
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

/// What a solve asks about once a millisecond, where it also looks at its stop token: on its own thread and
/// on those of a TaskRunner that work for it, which hold no lock then.
class Pause {
 public:
  virtual ~Pause() = default;
  /// May do other work, of whatever length, before it returns: the solve goes on then with the same bits.
  virtual void look() = 0;
  /// For how long the solve itself has been in look(), up to now. Time limits and times leave that out.
  [[nodiscard]] virtual std::chrono::steady_clock::duration paused() const = 0;
};

// As CSV: the same columns in the same order wherever a trace is written or read.

/// One column of a trace.
struct ProgressColumn {
  std::string_view name;                               ///< as in the header line
  bool integer = false;                                ///< whether its numbers are whole
  double (*get)(const Progress& row) = nullptr;        ///< reads it from a row
  void (*set)(Progress& row, double value) = nullptr;  ///< writes it to a row
};

/// All columns in their order: iteration, outer_iteration, objective, equality_violation,
/// inequality_violation, complementarity_violation, kkt_residual, kappa, rho, step_length, regularization,
/// factorizations, elapsed_s, incumbent, bound, gap, nodes, open_nodes. Violations are in the user's units.
[[nodiscard]] std::span<const ProgressColumn> progress_columns();

/// Traces of before there were trees end with elapsed_s.
inline constexpr std::size_t kColumnsBeforeTrees = 13;

/// The names, separated by commas, without a line break.
[[nodiscard]] std::string progress_csv_header();

/// Appends the row's numbers, separated by commas, without a line break. The shortest text that keeps every
/// bit, whatever the locale; a number that is none is nan, inf or -inf.
void append_progress_csv(const Progress& row, std::string& text);

}  // namespace marble
