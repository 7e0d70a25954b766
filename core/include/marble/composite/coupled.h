// Several LCQPs (blocks) with coupling rows, solved block by block: ALADIN (Houska, Frasch and Diehl 2016),
// but blocks keep their pairs. core/ALGORITHM.md contains the formulas.
//
//   min Σ f_k(z_k)   s.t.   z_k feasible for LCQP_k,   Σ E_k z_k = e
//
//   auto answer = marble::solve_coupled(view);         // all in this process, blocks on a TaskRunner
//   auto ended = marble::coordinate(ticks, e);         // blocks anywhere, behind BlockTicks
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/solution.h"
#include "marble/solver.h"

namespace marble {

/// Maximum number of coupling rows: the coordinator factorizes a dense matrix of this size in every
/// iteration.
inline constexpr Index kMostCouplingRows = 2000;
/// Maximum number of blocks of one coupled problem.
inline constexpr std::size_t kMostBlocks = 10'000;

/// One LCQP and its part of the coupling rows. Borrows its arrays.
struct CoupledBlock {
  std::string name = {};           ///< for display and error messages; may be empty
  ProblemView problem;             ///< n_k variables
  SparseMatrixView coupling = {};  ///< E_k, m × n_k; absent if the block appears in no coupling row
};

/// A coupled problem. Borrows its arrays.
struct CoupledView {
  std::vector<CoupledBlock> blocks;      ///< at least one
  std::span<const double> coupling_rhs;  ///< coupling right-hand side e, m; its size defines m
};

/// Options of a coupled solve.
struct CoupledOptions {
  Options options = {};  ///< of blocks and monolithic solve; the time limit covers all
  /// Initial ρ > 0 of ½ρ‖E_k(y_k − z_k)‖², which holds a block near its point of the last iteration. If the
  /// blocks diverge, ρ is raised tenfold, and the iteration resumes from the best one so far.
  double proximal = 1.0;
  int max_iterations = 60;  ///< iterations of the coordinator, >= 1
  /// Number of iterations after which every pair keeps its side; >= 0, and 0 only if the start determines the
  /// sides.
  int freeze_after = 15;
  /// Maximum number of searches, >= 0. Once the blocks agree, each looks for a better branch with the
  /// multipliers found, by a cold solve; if one finds it, the iteration continues.
  int max_searches = 3;
  int max_pair_switches =
      20;  ///< maximum number of pairs of frozen blocks that are tried on their other side; >= 0
  double tolerance = 1e-9;  ///< relative, for Σ E_k y_k − e and for the last step; in (0, 1)
  /// Whether the branch found is solved exactly as one monolithic problem, and certified like any solution.
  /// If not, the solution consists of the blocks' own ones, and the coupling rows hold to `tolerance`.
  bool monolithic = true;
  /// Whether better branches of the monolithic problem are searched for before that, near the one that the
  /// blocks found: a local search and further starts, which take about as long as solving it as a whole.
  bool monolithic_search = true;

  /// Checks all options. Errors name the field: "proximal", ….
  [[nodiscard]] Expected<void> check() const;
};

/// One iteration of the coordinator.
struct CoupledIteration {
  std::int32_t iteration = 0;       ///< from 1
  double coupling_violation = 0.0;  ///< max |Σ E_k y_k − e|
  double step = 0.0;                ///< max ρ|E_k(y_k − z_k)|
  double objective = 0.0;           ///< Σ f_k(y_k); NaN if the blocks do not report it
  double proximal = 0.0;            ///< ρ
  bool frozen = false;              ///< every pair keeps its side
  std::int64_t factorizations = 0;  ///< factorizations of all blocks so far
};

/// The start of a coupled solve: the solution of a similar one, or a guess.
struct CoupledStart {
  std::vector<double> coupling_multipliers;  ///< multipliers λ, m; empty: zeros
  std::vector<Solution>
      blocks;  ///< z and multipliers of each block, with the block's own sizes; empty: unknown
};

class LiftedBlock;

/// Solves a LiftedBlock's problem() repeatedly: a Solver in this process, or a session of a server.
class BlockSolver {
 public:
  virtual ~BlockSolver() = default;
  /// Applies the changes of problem() and solves it, starting from a solution of its previous state, or cold
  /// if there is none. Returns an error only if the solver cannot be reached; any status of the solve is a
  /// solution.
  [[nodiscard]] virtual Expected<Solution> solve(const ProblemUpdate& update, const Solution* start) = 0;
};

/// Creates a solver for the current problem(): the block's first solver, or another one after freezing. The
/// block outlives it. Called by any thread, by several at once.
using OpenBlockSolver = std::function<Expected<std::unique_ptr<BlockSolver>>(const LiftedBlock& block)>;

/// Optional controls of a coupled solve.
struct CoupledControls {
  std::function<void(const CoupledIteration&)> progress = {};  ///< called after every iteration
  std::stop_token stop = {};                                   ///< checked as in SolveControls
  /// All blocks of an iteration run on it at once. Without a runner they run one after the other. The
  /// solution is the same to the last bit.
  TaskRunner* runner = nullptr;
  Pause* pause = nullptr;  ///< as in SolveControls; asked by all threads that work for the solve
  /// Creates the blocks' solvers; by default a local Solver for each block.
  OpenBlockSolver open = {};
  /// most_bytes limits working_bytes() plus the solvers of all local blocks, and then plus the monolithic
  /// one; most_factorization_s applies to each solver. The stop token, pause and end time in it are ignored.
  SetupControls setup = {};
  const CoupledStart* start = nullptr;  ///< must outlive the call
  /// When the time limit began; by default the beginning of the solve.
  std::optional<std::chrono::steady_clock::time_point> begun = {};
  ActivityMonitor* activity = nullptr;  ///< as in SolveControls
};

/// The coordinator's request to a block.
struct BlockAsk {
  std::vector<double> price;   ///< multipliers λ of the block's coupling rows
  std::vector<double> centre;  ///< E_k z_k of those rows: the center of the proximal term
  double proximal = 1.0;       ///< ρ
  bool search = false;         ///< solve both from the last solution and cold; the better solution is used
  bool frozen = false;         ///< from now on, each pair keeps the side that is at zero
  std::vector<Index> switched_pairs;  ///< pairs of a frozen block that first switch to their other side
};

/// A frozen pair whose fixed side has a wrong-sign multiplier while the other side is nearly zero: the
/// objective would fall on the other branch.
struct BlockPull {
  Index pair = 0;
  double pull = 0.0;  ///< −multiplier of the fixed side, > 0
};

/// A block's response: its minimum of f_k(y) + λᵀE_k y + ½ρ‖E_k(y − z)‖², and how that minimum would change.
struct BlockAnswer {
  Status status = Status::numerical_failure;  ///< as of every solve
  std::string detail;                         ///< as of every solve
  std::vector<double> value;                  ///< E_k y_k, for the block's coupling rows: m_k
  std::vector<double> response;  ///< S_k = E_k P_k E_kᵀ by columns, m_k × m_k: −d(E_k y_k)/dλ on its branch,
                                 ///< without the proximal term; empty if the block is not solved
  double objective = 0.0;  ///< f_k(y_k); NaN if not reported
  std::int32_t factorizations = 0;
  std::vector<BlockPull> pulls;  ///< for a frozen block
  Solution solution;             ///< y_k with multipliers, in the block's own sizes; empty if not reported
};

/// The blocks, wherever they are: in this process, in a server's workers, in sessions on several servers, or
/// with a party that reveals nothing of its problem except these responses.
class BlockTicks {
 public:
  virtual ~BlockTicks() = default;
  /// Returns the coupling rows of each block, ascending.
  [[nodiscard]] virtual std::span<const std::vector<Index>> rows() const = 0;
  /// Returns the initial E_k z_k of a block, m_k; empty: zeros.
  [[nodiscard]] virtual std::vector<double> start(std::size_t block) const = 0;
  /// Returns a name for messages: "block 3 (arm)".
  [[nodiscard]] virtual std::string name(std::size_t block) const = 0;
  /// Solves all blocks, with one request for each, and returns when all have ended. Returns an error only if
  /// a block cannot be reached; any status of its solve is a response.
  [[nodiscard]] virtual Expected<std::vector<BlockAnswer>> tick(std::span<const BlockAsk> asks) = 0;
};

/// The result of the coordinator's iteration.
struct Coordination {
  /// solved: the blocks agree. almost_solved: they agree, but one of them is almost solved. iteration_limit:
  /// they do not agree yet. Otherwise the status of the block that failed.
  Status status = Status::numerical_failure;
  std::string detail;  ///< one sentence; it names a block that failed
  std::optional<std::size_t> failed_block = {};
  std::vector<double> coupling_multipliers;  ///< multipliers λ, m
  std::vector<BlockAnswer> answers;          ///< the last responses, including that of a block that failed
  CoupledIteration last = {};                ///< the last iteration
  std::int32_t frozen_at = 0;                ///< the iteration in which the pairs were frozen; 0: never
  std::int32_t pair_switches = 0;            ///< pairs that stayed on their other side
};

/// Iterates until the blocks agree. `coupling_rhs`: e. `options.monolithic` is ignored. Errors:
/// invalid_argument of the fields of CoupledOptions, or of "coupling_rhs"; and the errors of tick().
[[nodiscard]] Expected<Coordination> coordinate(BlockTicks& blocks, std::span<const double> coupling_rhs,
                                                const CoupledOptions& options = {},
                                                const CoupledControls& controls = {});

/// Where a block's vectors begin in those of the monolithic problem.
struct BlockPlace {
  Index variables = 0;     ///< first of z
  Index equalities = 0;    ///< first of the equality multipliers
  Index inequalities = 0;  ///< first of the inequality multipliers
  Index pairs = 0;         ///< first of both multipliers of the pairs
};

/// The solution of a coupled problem.
struct CoupledSolution {
  /// Solution of the monolithic problem: the vectors of all blocks one after the other, at `places`. The last
  /// m equality multipliers are the multipliers λ of the coupling rows. Its factorizations are those of the
  /// monolithic solve.
  Solution monolithic;
  std::vector<BlockPlace> places;  ///< one for each block, and one more for the ends
  Coordination coordination;       ///< how the blocks reached it
  double blocks_objective = 0.0;   ///< Σ f_k(y_k) of the blocks, before the monolithic solve
  /// Returns the multipliers λ of the coupling rows, m.
  [[nodiscard]] std::span<const double> coupling_multipliers() const {
    return std::span(monolithic.equality_multipliers)
        .subspan(static_cast<std::size_t>(places.back().equalities));
  }
};

/// Returns the memory of a coupled solve without its solvers, in bytes: dense matrices of the rows, copies of
/// the problems.
[[nodiscard]] std::int64_t working_bytes(const CoupledView& view);

/// Checks everything and names the first error: "blocks[3].problem.A.values", "blocks[0].coupling.rows",
/// "coupling_rhs".
[[nodiscard]] Expected<void> check(const CoupledView& view);

/// Returns all blocks and coupling rows as one LCQP: the variables, rows and pairs of the blocks in their
/// order; the coupling rows Σ E_k z_k − e = 0 are the last equalities. The view must have passed check().
[[nodiscard]] OwnedProblem monolithic_problem(const CoupledView& view);
/// Returns where the blocks begin in it, and the ends.
[[nodiscard]] std::vector<BlockPlace> monolithic_places(const CoupledView& view);

/// Solves a coupled problem in this process. Errors: as check(), CoupledOptions::check() and Solver::create.
[[nodiscard]] Expected<CoupledSolution> solve_coupled(const CoupledView& view,
                                                      const CoupledOptions& options = {},
                                                      const CoupledControls& controls = {});

/// The last part of solve_coupled, after the blocks. Solves the monolithic problem exactly from the blocks'
/// results or, depending on the options, returns the blocks' own solution. If a stop or the time limit ended
/// the blocks, the solution is their last point.
[[nodiscard]] Expected<CoupledSolution> finish_coupled(const CoupledView& view, Coordination coordination,
                                                       const CoupledOptions& options,
                                                       const CoupledControls& controls);

}  // namespace marble
