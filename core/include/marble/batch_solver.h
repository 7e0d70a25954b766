// Solves many problems that differ only in their numbers: one pattern, set up once, and arrays of elements.
//
//   auto solver = marble::BatchSolver::create(*problem, options);
//   auto result = solver->solve({.count = 1000, .b = states});  // states: 1000 × n_e, result->z: 1000 × n
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <vector>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/solution.h"
#include "marble/solver.h"

namespace marble {

/// The largest number of elements of one batch.
inline constexpr std::size_t most_batch_elements = 100'000'000;

/// The numbers of a batch, element after element: of each part either none, which leaves the numbers of the
/// problem that was set up, or `count` times as many as that part has. Borrows its arrays.
struct BatchNumbers {
  std::size_t count = 0;            ///< elements, in [0, most_batch_elements]
  std::span<const double> c0 = {};  ///< count
  std::span<const double> g = {};   ///< count × n
  std::span<const double> b = {};   ///< count × n_e
  std::span<const double> d = {};   ///< count × n_i
  std::span<const double> l = {};   ///< count × n_c
  std::span<const double> r = {};   ///< count × n_c
  std::span<const double> Q = {};   ///< count × entries; of a full Q, upper ones are used
  std::span<const double> A = {};   ///< count × entries, in the order of the problem that was set up
  std::span<const double> C = {};   ///< count × entries
  std::span<const double> L = {};   ///< count × entries
  std::span<const double> R = {};   ///< count × entries
  /// count × n: where each element begins. If it is feasible, the solution is not above that of its branch.
  std::span<const double> initial_z = {};
};

/// The solutions of a batch, element after element, in the user's units. An element that was not reached
/// before the stop token or the time limit ended the batch has the status cancelled or time_limit, no
/// factorizations, and NaN as every other number.
struct BatchResult {
  std::size_t count = 0;             ///< elements
  std::vector<Status> status;        ///< count: why each solve ended
  std::vector<double> z;             ///< count × n: the best point of each
  std::vector<double> objective;     ///< count, as in Solution
  std::vector<double> violations;    ///< count × 3: of equalities, inequalities and pairs, as in Violations
  std::vector<double> kkt_residual;  ///< count, as in Solution
  std::vector<std::int32_t> factorizations;           ///< count
  std::vector<double> equality_multipliers;           ///< count × n_e; empty unless requested, as the next
  std::vector<double> inequality_multipliers;         ///< count × n_i
  std::vector<double> complementarity_multipliers_L;  ///< count × n_c
  std::vector<double> complementarity_multipliers_R;  ///< count × n_c
  double solve_s = 0.0;                               ///< time of the whole batch, in seconds

  /// Returns the number of elements with a status for which is_solved().
  [[nodiscard]] std::size_t solved() const;
};

/// Optional controls of a batch.
struct BatchSolverControls {
  /// Threads that solve at once, the calling one included, in [0, 256]; 0: one per processor. The result is
  /// the same to the last bit. Each has a solver with its own memory, which is kept for the next batch.
  int threads = 0;
  std::stop_token stop = {};  ///< ends the batch; checked about once per millisecond
  bool multipliers = false;   ///< returns the multipliers of each element
  /// The result of another batch of as many elements for the same problem, with multipliers: each element
  /// starts from its own solution there, if that is solved, and no element is solved cold otherwise than
  /// where this fails. A loop of many controllers uses its last result.
  const BatchResult* start = nullptr;
};

/// Solves elements of one pattern. Scaling, ordering and analysis are those of the problem it was made from.
///
/// Where an element starts depends only on the numbers of the batch, not on threads or time. A few elements,
/// spread over the batch, are solved cold, as by Solver::update and solve; then more and more others, from
/// the branches of the nearest solved ones, followed by a search around the best of these. Near is by the
/// numbers that differ within the batch, each over its standard deviation; of more than eight, by a fixed
/// random projection. At least 99 % of cart-poles, hoppers and small problems end no higher than a cold solve
/// of their own; of random problems with 30 pairs 94 %, and 4 % end lower.
/// Options that search longer (global_search, num_starts > 1), path other than fast, and polish = false solve
/// every element cold. One thread at a time may use a BatchSolver.
class BatchSolver {
 public:
  /// Sets up for the pattern of `problem` and copies its numbers. Options must be valid and without explain;
  /// time_limit_s is that of a whole batch, without the set-up. `controls` limit each thread's solver.
  /// Errors: as Solver::create.
  [[nodiscard]] static Expected<BatchSolver> create(const Problem& problem, const Options& options = {},
                                                    const SetupControls& controls = {});

  /// A moved-from BatchSolver may only be assigned to or destroyed.
  BatchSolver(BatchSolver&&) noexcept;
  /// As the move constructor.
  BatchSolver& operator=(BatchSolver&&) noexcept;
  ~BatchSolver();

  /// Solves every element. Errors, before anything is solved: invalid_argument of a field with the wrong
  /// number of entries, or of the first number that is not finite, "g[12]" with the index in the numbers of
  /// element 12; of "count", "threads" and "start". resource_exhausted if the result does not fit the memory.
  [[nodiscard]] Expected<BatchResult> solve(const BatchNumbers& numbers,
                                            const BatchSolverControls& controls = {});

  /// Returns the memory of all threads' solvers, in bytes, as estimated by Solver::create.
  [[nodiscard]] std::int64_t memory_bytes() const;
  /// Returns the sizes of the problem that was set up.
  [[nodiscard]] const PartSizes& sizes() const;

 private:
  struct State;
  class Batch;
  explicit BatchSolver(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace marble
