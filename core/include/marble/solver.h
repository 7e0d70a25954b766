// The solver: set up once for each sparsity pattern, then solve as often as the numbers change.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/report/proof.h"
#include "marble/solution.h"

namespace marble {

class ReferenceMethods;
struct Shift;

/// Runs independent tasks of one solve.
class TaskRunner {
 public:
  virtual ~TaskRunner() = default;
  /// Runs every task once, on any threads, and returns when all have ended. No task throws.
  virtual void run(std::span<const std::function<void()>> tasks) = 0;
};

/// Optional controls of one solve. Unused ones cost nothing.
struct SolveControls {
  ProgressSink* progress = nullptr;  ///< called after every iteration
  std::stop_token stop = {};         ///< checked about once per millisecond
  /// n or empty: where a cold start begins (user units). If it is feasible, its branch is solved first, and
  /// the solution is never above that branch's solution, even if the solve is stopped.
  std::span<const double> initial_z = {};
  /// A solution of this problem or of a similar one with the same sizes, with z and multipliers: its branch
  /// is tried first. If its z is feasible for the current numbers, the new solution is not above it.
  const Solution* warm_start = nullptr;
  /// Requests derivatives of the solution with respect to the problem's numbers, from the last factor of the
  /// solve.
  const SensitivityRequest* sensitivity = nullptr;
  /// With option num_starts > 1, further starts run on it, four at a time. Without a runner they run one
  /// after the other. The solution is the same to the last bit.
  TaskRunner* runner = nullptr;
  Pause* pause = nullptr;  ///< asked whether to yield to other work; must outlive the solve
  /// When the time limit began, if it also covers the set-up; by default the beginning of the solve.
  std::optional<std::chrono::steady_clock::time_point> begun = {};
  ActivityMonitor* activity = nullptr;  ///< shows other threads what the solve is doing
  /// Receives the proof of the solution's bound, or the reason why there is none; must outlive the solve. The
  /// tree of a session's solve then begins at the root.
  Proof* proof = nullptr;
};

/// Checks that a solution can be the `warm_start` of a problem of these sizes: z and each kind of multipliers
/// must have the right number of entries, all finite. Errors name "warm_start.z",
/// "warm_start.equality_multipliers", ….
[[nodiscard]] Expected<void> check_warm_start(const Solution& start, const PartSizes& sizes);

/// Limits of a solver's resources, and conditions that end its set-up.
struct SetupControls {
  std::int64_t most_bytes = std::numeric_limits<std::int64_t>::max();  ///< memory limit in bytes
  /// Limit for one factorization, in seconds, on an assumed machine that is faster than any real one: a
  /// problem whose flops need more is hopeless. The time limit of the options replaces it if that is less.
  double most_factorization_s = std::numeric_limits<double>::infinity();
  std::stop_token stop = {};  ///< checked about once per millisecond
  Pause* pause = nullptr;     ///< as in SolveControls
  /// The time at which the set-up ends; by default never.
  std::chrono::steady_clock::time_point until = std::chrono::steady_clock::time_point::max();
  /// The published methods of option `method`: marble/research/methods.h has them. Without them, only
  /// method = marble is valid.
  const ReferenceMethods* reference_methods = nullptr;
};

/// Owns a scaled copy of the problem, the symbolic factorization and all workspace.
/// One thread at a time may use a Solver; different Solvers are independent.
class Solver {
 public:
  /// Scales, analyses and allocates. Options must be valid; with reference_methods in the controls, `method`
  /// may be any, else only marble. The symbolic factorization gives the memory and
  /// the flops before anything numeric is allocated; a problem that needs more than the controls allow is
  /// refused with resource_exhausted, field "problem". A set-up that ends early returns cancelled or
  /// deadline_exceeded.
  [[nodiscard]] static Expected<Solver> create(const Problem& problem, const Options& options = {},
                                               const SetupControls& controls = {});

  /// A moved-from Solver may only be assigned to or destroyed.
  Solver(Solver&&) noexcept;
  /// As the move constructor.
  Solver& operator=(Solver&&) noexcept;
  ~Solver();

  /// Sets new numbers in the same pattern for the following solves. Scaling, ordering and workspace are kept;
  /// an update of vectors allocates nothing. Errors name the field and the index; nothing has changed then.
  [[nodiscard]] Expected<void> update(const ProblemUpdate& update);

  /// Sets other options for the following solves; scaling_passes keeps its value from the set-up. Options
  /// must be valid.
  [[nodiscard]] Expected<void> set_options(const Options& options);

  /// Returns the memory in use, in bytes, as estimated by create().
  [[nodiscard]] std::int64_t memory_bytes() const;

  /// Solves, and returns a solution with a status in every case. Returns an error only if `initial_z`,
  /// `warm_start` or `sensitivity` do not have the problem's sizes or are not finite; fields of the last
  /// begin with "sensitivity.".
  [[nodiscard]] Expected<Solution> solve(const SolveControls& controls = {});

 private:
  friend class WarmSolver;   // which passes checked data, and shifts the tree together with its solution
  friend class BatchSolver;  // which passes checked data, and solves elements that do not depend on each
                             // other
  struct State;
  explicit Solver(std::unique_ptr<State> state);
  [[nodiscard]] Expected<Solution> solve(const SolveControls& controls, bool resumes, bool keeps_start,
                                         std::span<const Solution* const> near = {},
                                         bool compares_more = false);
  void return_to_setup(const ProblemUpdate& all_numbers);
  void take_element(const ProblemUpdate& checked, const ProblemUpdate& all_numbers);
  void prepare(const Solution& warm_start, const SolveControls& controls);
  [[nodiscard]] bool is_unfinished() const;
  void forget_unfinished();
  [[nodiscard]] bool is_feasible(const Solution& solution) const;
  [[nodiscard]] bool take_better(const Solution& previous, Solution& solution) const;
  void take(const ProblemUpdate& checked);
  void fit_scaling();
  void load_matrices();
  void take(const Options& checked);
  void keep_tree();
  void shift_tree(const Shift& by);
  std::unique_ptr<State> state_;
};

/// Sets up and solves; the time limit covers both. If the stop token or the limit ends the set-up, the
/// solution is the initial point. `setup` supplies only the limits; its stop token and end time are ignored.
/// `ready` is called with the solver before the solve begins. Errors: as Solver::create and Solver::solve.
[[nodiscard]] Expected<Solution> solve_once(const Problem& problem, const Options& options = {},
                                            const SolveControls& controls = {},
                                            const SetupControls& setup = {},
                                            const std::function<void(const Solver&)>& ready = {});

/// Validates, sets up and solves in one call in this process, as solve_once does. (marble::solve of the
/// client library uses a server if MARBLE_SERVER names one.)
[[nodiscard]] Expected<Solution> solve_in_process(const ProblemView& problem, const Options& options = {},
                                                  const SolveControls& controls = {});

}  // namespace marble
