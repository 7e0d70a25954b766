// The solver: set up once per sparsity pattern, solve as often as the vectors change.
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

struct Shift;

/// Runs pieces of one solve that do not depend on each other.
class TaskRunner {
 public:
  virtual ~TaskRunner() = default;
  /// Runs every task once, on whatever threads, and returns when all have ended. No task throws.
  virtual void run(std::span<const std::function<void()>> tasks) = 0;
};

/// What may accompany one solve; all of it optional, and free of cost when unused.
struct SolveControls {
  ProgressSink* progress = nullptr;  ///< told after every iteration
  std::stop_token stop = {};         ///< looked at about once a millisecond
  /// n or empty: where a cold start begins (user units). Where it is feasible its branch is solved first, and
  /// the answer is never above that branch's solution, also of a solve that is stopped.
  std::span<const double> initial_z = {};
  /// An answer to this problem or one like it, of the same sizes, z and multipliers: its branch is tried
  /// first. Where its z is feasible for the numbers of now, the answer is not above it.
  const Solution* warm_start = nullptr;
  /// Derivatives of the answer by the problem's numbers, by the factor that the solve ends with.
  const SensitivityRequest* sensitivity = nullptr;
  /// For option starts > 1: further starts run on it, four at a time. Without one they run one after the
  /// other; the answer is the same to the last bit.
  TaskRunner* runner = nullptr;
  Pause* pause = nullptr;  ///< asked whether to step aside; must outlive the solve
  /// When the time limit began to run, where the set-up is to count; else as the solve begins.
  std::optional<std::chrono::steady_clock::time_point> begun = {};
  ActivityMonitor* activity = nullptr;  ///< shows other threads what the solve is doing
  /// Filled with what proves the answer's bound, or that there is none; must outlive the solve. Of a
  /// session's solve its tree begins at the root then.
  Proof* proof = nullptr;
};

/// Whether an answer may be a `warm_start` of a problem of these sizes: as many entries in z and each kind of
/// multipliers, all finite. Errors name "warm_start.z", "warm_start.equality_multipliers" and such.
[[nodiscard]] Expected<void> check_warm_start(const Solution& start, const PartSizes& sizes);

/// What a solver may take, and what ends its set-up.
struct SetupControls {
  std::int64_t most_bytes = std::numeric_limits<std::int64_t>::max();  ///< of memory
  /// Of one factorization, in seconds, as a machine faster than any would need for its flops: more means that
  /// there is no hope. The time limit of the options, if it is less, takes its place.
  double most_factorization_s = std::numeric_limits<double>::infinity();
  std::stop_token stop = {};  ///< looked at about once a millisecond
  Pause* pause = nullptr;     ///< as that of a solve
  /// The moment that ends it; never, unless it is said.
  std::chrono::steady_clock::time_point until = std::chrono::steady_clock::time_point::max();
};

/// Owns a scaled copy of the problem, the symbolic factorization and all workspace.
/// One thread at a time may use a Solver; different Solvers are independent.
class Solver {
 public:
  /// Scales, analyses and allocates. Options must be valid. A problem whose memory or flops, known from the
  /// symbolic factorization before anything numeric is allocated, would be more than the controls allow is
  /// refused with resource_exhausted, field "problem"; what ends early gives cancelled or deadline_exceeded.
  [[nodiscard]] static Expected<Solver> create(const Problem& problem, const Options& options = {},
                                               const SetupControls& controls = {});

  /// What was moved from may only be assigned to or destroyed.
  Solver(Solver&&) noexcept;
  /// As the constructor.
  Solver& operator=(Solver&&) noexcept;
  ~Solver();

  /// New numbers in the same pattern, for solves to come. Scaling, ordering and workspace stay; an update of
  /// vectors allocates nothing. Errors name the field and the index; nothing has changed then.
  [[nodiscard]] Expected<void> update(const ProblemUpdate& update);

  /// Other options for solves to come; scaling_passes keeps what it was set up with. Options must be valid.
  [[nodiscard]] Expected<void> set_options(const Options& options);

  /// What it takes, in bytes, by the estimate of create().
  [[nodiscard]] std::int64_t memory_bytes() const;

  /// Runs to an end and says which. An error only if `initial_z`, `warm_start` or `sensitivity` have other
  /// sizes than the problem or are not finite; of the last one fields begin with "sensitivity.".
  [[nodiscard]] Expected<Solution> solve(const SolveControls& controls = {});

 private:
  friend class WarmSolver;  // which takes what was checked before, and moves the tree on with its answer
  struct State;
  explicit Solver(std::unique_ptr<State> state);
  [[nodiscard]] Expected<Solution> solve(const SolveControls& controls, bool resumes, bool keeps_start);
  void prepare(const Solution& warm_start, const SolveControls& controls);
  [[nodiscard]] bool is_unfinished() const;
  void forget_unfinished();
  [[nodiscard]] bool is_feasible(const Solution& solution) const;
  [[nodiscard]] bool take_better(const Solution& previous, Solution& solution) const;
  void take(const ProblemUpdate& checked);
  void take(const Options& checked);
  void keep_tree();
  void shift_tree(const Shift& by);
  std::unique_ptr<State> state_;
};

/// Sets up and solves: the time limit counts both. Where the stop token or the limit ends the set-up the
/// answer is the initial point. `setup` gives the limits; its own ends are not looked at. `ready` is told of
/// the solver before it begins. Errors: as Solver::create and Solver::solve name them.
[[nodiscard]] Expected<Solution> solve_once(const Problem& problem, const Options& options = {},
                                            const SolveControls& controls = {},
                                            const SetupControls& setup = {},
                                            const std::function<void(const Solver&)>& ready = {});

/// Validates, sets up and solves in one call, here, as solve_once does. (marble::solve of the client library
/// goes to a server where MARBLE_SERVER names one.)
[[nodiscard]] Expected<Solution> solve_in_process(const ProblemView& problem, const Options& options = {},
                                                  const SolveControls& controls = {});

}  // namespace marble
