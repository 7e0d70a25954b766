// Several LCQPs that rows between them tie together, solved block by block: ALADIN (Houska, Frasch and Diehl
// 2016), whose blocks here keep their pairs as they are. core/ALGORITHM.md has the formulas.
//
//   min Σ f_k(z_k)   s.t.   z_k feasible for LCQP_k,   Σ E_k z_k = e
//
//   auto answer = marble::solve_coupled(view);         // all in this process, blocks on a TaskRunner
//   auto ended = marble::coordinate(ticks, e);         // blocks wherever BlockTicks has them
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

/// Rows that may tie blocks: the coordinator factorizes a dense matrix of this size in every iteration.
inline constexpr Index kMostCouplingRows = 2000;
/// Blocks of one coupled problem.
inline constexpr std::size_t kMostBlocks = 10'000;

/// One LCQP and what the rows between blocks see of it. Borrows its arrays.
struct CoupledBlock {
  std::string name = {};           ///< for people, in faults; may be empty
  ProblemView problem;             ///< n_k variables
  SparseMatrixView coupling = {};  ///< E_k, m × n_k; absent where no row sees the block
};

/// A coupled problem. Borrows its arrays.
struct CoupledView {
  std::vector<CoupledBlock> blocks;  ///< at least one
  std::span<const double> total;     ///< e, m; its size defines m
};

/// How a coupled problem is solved.
struct CoupledOptions {
  Options options = {};  ///< of every block's solves, and of the joint one; the time limit counts all
  /// First ρ > 0 of ½ρ‖E_k(y_k − z_k)‖², what holds a block where the last iteration was. Where blocks move
  /// apart it is raised tenfold, from the best iteration so far.
  double proximal = 1.0;
  int max_iterations = 60;  ///< of the coordinator, >= 1
  /// Iterations, after which every pair keeps its side; >= 0, and 0 only from a start that knows the sides.
  int freeze_after = 15;
  /// Once the blocks agree each looks for a better branch at the prices found, by a cold solve, and they go
  /// on if one has it; so often at most, >= 0.
  int searches = 3;
  int flips = 20;           ///< pairs of frozen blocks that may be tried on their other side; >= 0
  double tolerance = 1e-9;  ///< of Σ E_k y_k − e and of the last step, relative; in (0, 1)
  /// Whether the branch that was found is solved once more as one problem, exactly, certified as any answer.
  /// Where not, the answer is the blocks' own, and the coupling rows hold to `tolerance`.
  bool joint = true;
  /// Whether better branches of the joint problem are looked for before that, near the one that the blocks
  /// have found: a local search and further starts, which takes about as long as solving it whole.
  bool joint_search = true;

  /// Errors name the field: "proximal" and such.
  [[nodiscard]] Expected<void> check() const;
};

/// One iteration of the coordinator.
struct CoupledIteration {
  std::int32_t iteration = 0;       ///< from 1
  double coupling_violation = 0.0;  ///< max |Σ E_k y_k − e|
  double step = 0.0;                ///< max ρ|E_k(y_k − z_k)|
  double objective = 0.0;           ///< Σ f_k(y_k); NaN where the blocks keep it to themselves
  double proximal = 0.0;            ///< ρ
  bool frozen = false;              ///< every pair keeps its side by now
  std::int64_t factorizations = 0;  ///< of all blocks so far
};

/// Where a coupled solve begins: with the answer of one like it, or a guess.
struct CoupledStart {
  std::vector<double> prices;  ///< λ, m; empty: zeros
  std::vector<Solution>
      blocks;  ///< z and multipliers of each block, in its own sizes; empty: nothing is known
};

class LiftedBlock;

/// Solves a LiftedBlock's problem() again and again: a Solver in this process, or a session of a server.
class BlockSolver {
 public:
  virtual ~BlockSolver() = default;
  /// Takes what has changed in problem(), and solves it from an answer to what it was; cold where there is
  /// none. An error only where it cannot be asked: any outcome of the solve is an answer.
  [[nodiscard]] virtual Expected<Solution> solve(const ProblemUpdate& update, const Solution* start) = 0;
};

/// Sets one up for problem() as it is then: the block's first solver, or another one as it was frozen. The
/// block outlives it. Called by any thread, by several at once.
using OpenBlockSolver = std::function<Expected<std::unique_ptr<BlockSolver>>(const LiftedBlock& block)>;

/// What may accompany a coupled solve; all of it optional.
struct CoupledControls {
  std::function<void(const CoupledIteration&)> progress = {};  ///< told after every iteration
  std::stop_token stop = {};                                   ///< looked at as SolveControls has it
  /// Blocks run on it, all of an iteration at once. Without one they run one after the other; the answer is
  /// the same to the last bit.
  TaskRunner* runner = nullptr;
  /// Where blocks are solved; unless it is said, here, by a Solver each.
  OpenBlockSolver open = {};
  /// most_bytes is of working_bytes() with all blocks' solvers, where they are here, and then with the joint
  /// one; most_factorization_s of each. Its own ends are not looked at.
  SetupControls setup = {};
  const CoupledStart* start = nullptr;  ///< must outlive the call
  /// When the time limit began to run; else as the solve begins.
  std::optional<std::chrono::steady_clock::time_point> begun = {};
  ActivityMonitor* activity = nullptr;  ///< as SolveControls has it
};

/// What the coordinator asks of a block.
struct BlockAsk {
  std::vector<double> price;   ///< λ of the rows that see it
  std::vector<double> centre;  ///< E_k z_k of those rows: where the proximal term holds it
  double proximal = 1.0;       ///< ρ
  bool search = false;         ///< besides from the last answer, start from nothing; the better one counts
  bool frozen = false;         ///< from now on each pair keeps the side that it has at zero
  std::vector<Index> flips;    ///< pairs of a frozen block that take the other side first
};

/// A frozen pair whose fixed side pulls while the other is nearly zero: the objective would fall on the other
/// branch.
struct BlockPull {
  Index pair = 0;
  double pull = 0.0;  ///< −multiplier of the fixed side, > 0
};

/// What a block answers: its minimum of f_k(y) + λᵀE_k y + ½ρ‖E_k(y − z)‖², and how that would go on.
struct BlockAnswer {
  Status status = Status::numerical_failure;  ///< as of any solve
  std::string detail;                         ///< as of any solve
  std::vector<double> value;                  ///< E_k y_k, of the rows that see it: m_k
  std::vector<double> response;  ///< S_k = E_k P_k E_kᵀ by columns, m_k × m_k: −d(E_k y_k)/dλ on its branch,
                                 ///< without the proximal term; empty where it is not solved
  double objective = 0.0;  ///< f_k(y_k); NaN if it is kept
  std::int32_t factorizations = 0;
  std::vector<BlockPull> pulls;  ///< of a frozen block
  Solution solution;             ///< y_k with multipliers, in the block's own sizes; empty if it is kept
};

/// Blocks, wherever they are: in this process, in a server's workers, over sessions on several servers, or
/// with an agent who tells no more of its problem than these answers.
class BlockTicks {
 public:
  virtual ~BlockTicks() = default;
  /// For each block the rows that see it, ascending.
  [[nodiscard]] virtual std::span<const std::vector<Index>> rows() const = 0;
  /// E_k z_k where a block begins, m_k; empty: zeros.
  [[nodiscard]] virtual std::vector<double> start(std::size_t block) const = 0;
  /// For people: "block 3 (arm)".
  [[nodiscard]] virtual std::string name(std::size_t block) const = 0;
  /// Solves all blocks, one ask for each, and returns when all have answered. An error only where a block
  /// cannot be asked: any outcome of its solve is an answer.
  [[nodiscard]] virtual Expected<std::vector<BlockAnswer>> tick(std::span<const BlockAsk> asks) = 0;
};

/// How the coordinator's iteration ended.
struct Coordination {
  /// solved: the blocks agree. iteration_limit: they don't yet. Else that of the block which failed.
  Status status = Status::numerical_failure;
  std::string detail;  ///< a sentence; of a block that failed, its name
  std::optional<std::size_t> failed_block = {};
  std::vector<double> prices;        ///< λ, m
  std::vector<BlockAnswer> answers;  ///< the last ones; those of the block that failed too
  CoupledIteration last = {};        ///< the last iteration
  std::int32_t frozen_at = 0;        ///< the iteration in which the pairs were frozen; 0: never
  std::int32_t flips = 0;            ///< pairs that took their other side for good
};

/// Brings the blocks to agree. `total`: e. `options.joint` is not its own. Errors: invalid_argument of the
/// fields of CoupledOptions, or of "total"; and what tick() says.
[[nodiscard]] Expected<Coordination> coordinate(BlockTicks& blocks, std::span<const double> total,
                                                const CoupledOptions& options = {},
                                                const CoupledControls& controls = {});

/// Where a block's vectors lie in the joint ones.
struct BlockPlace {
  Index variables = 0;     ///< first of z
  Index equalities = 0;    ///< first of the equality multipliers
  Index inequalities = 0;  ///< first of theirs
  Index pairs = 0;         ///< first of both of theirs
};

/// The answer of a coupled problem.
struct CoupledSolution {
  /// Of the joint problem: all blocks' vectors one after the other, as `places` tells; the multipliers λ of
  /// the coupling rows are the last m of the equalities'. Its factorizations are those of the joint solve.
  Solution joint;
  std::vector<BlockPlace> places;  ///< one a block, and one more: the ends
  Coordination coordination;       ///< how the blocks came to it
  double blocks_objective = 0.0;   ///< Σ f_k(y_k) of the blocks, before the joint solve
  /// λ, m
  [[nodiscard]] std::span<const double> prices() const {
    return std::span(joint.equality_multipliers).subspan(static_cast<std::size_t>(places.back().equalities));
  }
};

/// What a coupled solve takes beside its solvers, in bytes: dense matrices of the rows, copies of the
/// problems.
[[nodiscard]] std::int64_t working_bytes(const CoupledView& view);

/// Checks everything and names the first fault: "blocks[3].problem.A.values", "blocks[0].coupling.rows",
/// "total".
[[nodiscard]] Expected<void> check(const CoupledView& view);

/// All blocks and rows as one LCQP: variables, rows and pairs of the blocks in their order, the coupling rows
/// Σ E_k z_k − e = 0 the last equalities. Of a view that check() has passed.
[[nodiscard]] OwnedProblem joint_problem(const CoupledView& view);
/// Where the blocks lie in it, with the ends.
[[nodiscard]] std::vector<BlockPlace> joint_places(const CoupledView& view);

/// Solves it in this process. Errors: as check(), CoupledOptions::check() and Solver::create name them.
[[nodiscard]] Expected<CoupledSolution> solve_coupled(const CoupledView& view,
                                                      const CoupledOptions& options = {},
                                                      const CoupledControls& controls = {});

/// What solve_coupled does after the blocks: the joint problem, exactly, from what they have found; or, as
/// the options say, their own answer. Where a stop or the time limit ended them it is where they were.
[[nodiscard]] Expected<CoupledSolution> finish_coupled(const CoupledView& view, Coordination coordination,
                                                       const CoupledOptions& options,
                                                       const CoupledControls& controls);

}  // namespace marble
