#include "composite/finish.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "composite/lifted_blocks.h"
#include "composite/monolithic_search.h"
#include "model/entries.h"
#include "model/interrupt.h"
#include "model/tuning.h"

namespace marble {
namespace {

void append(std::span<const double> values, std::vector<double>& to) {
  to.insert(to.end(), values.begin(), values.end());
}

// Joins the vectors of all blocks one after the other, followed by the coupling_multipliers.
Solution stacked(const Coordination& coordination) {
  Solution monolithic;
  for (const BlockAnswer& answer : coordination.answers) {
    append(answer.solution.z, monolithic.z);
    append(answer.solution.equality_multipliers, monolithic.equality_multipliers);
    append(answer.solution.inequality_multipliers, monolithic.inequality_multipliers);
    append(answer.solution.complementarity_multipliers_L, monolithic.complementarity_multipliers_L);
    append(answer.solution.complementarity_multipliers_R, monolithic.complementarity_multipliers_R);
  }
  append(coordination.coupling_multipliers, monolithic.equality_multipliers);
  return monolithic;
}

double most_of_a_column(const SparseMatrixView& m) {
  double most = 0.0;
  for (Index j = 0; j < m.columns; ++j) {
    double sum = 0.0;
    for_column(m, j, [&](Index, double value) { sum += std::abs(value); });
    most = std::max(most, sum);
  }
  return most;
}

// max |Σ E_k z_k − e|
double rows_violation(const CoupledView& view, const Coordination& coordination) {
  std::vector<double> sum(view.coupling_rhs.size());
  for (std::size_t row = 0; row < sum.size(); ++row) sum[row] = -view.coupling_rhs[row];
  for (std::size_t k = 0; k < coordination.answers.size(); ++k)
    for_entries(view.blocks[k].coupling, [&](Index row, Index j, double value) {
      sum[at(row)] += value * coordination.answers[k].solution.z[at(j)];
    });
  double most = 0.0;
  for (const double value : sum) most = std::max(most, std::abs(value));
  return most;
}

// M z + v
std::vector<double> rows_at(const SparseMatrixView& m, std::span<const double> v, std::span<const double> z) {
  std::vector<double> value(v.begin(), v.end());
  for_entries(m, [&](Index row, Index j, double entry) { value[at(row)] += entry * z[at(j)]; });
  return value;
}

// Uses the block's own rows, because its solver may have used others, those of frozen sides.
void add_violations(const ProblemView& p, std::span<const double> z, Violations& most) {
  for (const double value : rows_at(p.A, p.b, z)) most.equality = std::max(most.equality, std::abs(value));
  for (const double value : rows_at(p.C, p.d, z)) most.inequality = std::max(most.inequality, -value);
  const std::vector<double> s = rows_at(p.L, p.l, z), t = rows_at(p.R, p.r, z);
  for (std::size_t pair = 0; pair < s.size(); ++pair)
    most.complementarity = std::max(most.complementarity, std::abs(std::min(s[pair], t[pair])));
}

// Combines the blocks' results into values of the monolithic problem: bounds of what a new evaluation would
// give.
void report_by_blocks(const CoupledView& view, const Coordination& coordination, Solution& monolithic) {
  const bool solved = coordination.status == Status::solved;
  if (solved) {
    monolithic.stationarity = Stationarity::strong;
    monolithic.b_stationary = true;
    monolithic.second_order = SecondOrder::convex;
  }
  for (std::size_t k = 0; k < coordination.answers.size(); ++k) {
    const Solution& own = coordination.answers[k].solution;
    add_violations(view.blocks[k].problem, own.z, monolithic.violations);
    monolithic.kkt_residual =
        std::max(monolithic.kkt_residual,
                 own.kkt_residual + coordination.last.step * most_of_a_column(view.blocks[k].coupling));
    monolithic.stationarity = std::min(monolithic.stationarity, own.stationarity);
    monolithic.second_order = std::min(monolithic.second_order, own.second_order);
    monolithic.iterations += own.iterations;
  }
  monolithic.violations.equality =
      std::max(monolithic.violations.equality, rows_violation(view, coordination));
  // Strongly stationary blocks have no joint direction of descent; for other blocks nothing is known.
  if (solved && monolithic.stationarity != Stationarity::strong) {
    monolithic.b_stationary.reset();
    monolithic.second_order = std::min(monolithic.second_order, SecondOrder::necessary);
  }
}

// Extends the certificate of an infeasible block to the monolithic problem, with zeros outside the block.
std::vector<double> widened(const CoupledView& view, const std::vector<BlockPlace>& places, std::size_t k,
                            const Solution& own) {
  const BlockPlace &all = places.back(), &first = places[k], &end = places[k + 1];
  if (own.certificate.empty()) return {};
  std::vector<double> wide;
  const auto put = [&](std::size_t from, Index count, Index where, std::size_t size) {
    const std::size_t begin = wide.size();
    wide.resize(begin + size, 0.0);
    std::copy_n(own.certificate.begin() + static_cast<std::ptrdiff_t>(from), count,
                wide.begin() + static_cast<std::ptrdiff_t>(begin) + where);
  };
  const Index n_e = end.equalities - first.equalities, n_i = end.inequalities - first.inequalities,
              n_c = end.pairs - first.pairs;
  // (y, ν, ξ, η); y ends with the rows that define v, whose multipliers are zero because v is free.
  const std::size_t lifted_rows = own.certificate.size() - at(n_e + n_i + 2 * n_c);
  put(0, n_e, first.equalities, at(all.equalities) + view.coupling_rhs.size());
  put(at(n_e) + lifted_rows, n_i, first.inequalities, at(all.inequalities));
  put(at(n_e + n_i) + lifted_rows, n_c, first.pairs, at(all.pairs));
  put(at(n_e + n_i + n_c) + lifted_rows, n_c, first.pairs, at(all.pairs));
  return wide;
}

Expected<void> check_start(const CoupledView& view, const CoupledStart& start) {
  if (start.blocks.empty()) return {};
  if (start.blocks.size() != view.blocks.size()) {
    return unexpected(invalid("start.blocks", std::to_string(start.blocks.size()),
                              "answers; must be " + std::to_string(view.blocks.size()) + ", one a block"));
  }
  for (std::size_t k = 0; k < start.blocks.size(); ++k) {
    const auto problem = Problem::create(view.blocks[k].problem);
    if (auto valid = check_warm_start(start.blocks[k], PartSizes::of(*problem)); !valid) {
      const std::string& field = valid.error().field;
      return unexpected(
          of_field("start.blocks[" + std::to_string(k) + "]" + field.substr(field.find('.')), valid.error()));
    }
  }
  return {};
}

}  // namespace

Expected<void> charge(CoupledControls& controls, std::int64_t bytes, const char* field) {
  std::int64_t& left = controls.setup.most_bytes;
  if (bytes > left) {
    return unexpected(failure(ErrorCode::resource_exhausted, field,
                              std::to_string(bytes) + " bytes of dense matrices and copies",
                              "must be at most " + std::to_string(left)));
  }
  left -= bytes;
  return {};
}

std::int64_t copy_bytes(const ProblemView& p) {
  constexpr std::int64_t kEntry = sizeof(double) + sizeof(Index);
  std::int64_t entries = 0, numbers = 0;
#define MARBLE_VECTOR(letter, field) numbers += std::ssize(p.letter);
#define MARBLE_MATRIX(letter, field, update, vector) entries += std::ssize(p.letter.values);
#include "marble/contract.def"
  const std::int64_t pointers = 5 * (std::ssize(p.g) + 1);
  return kEntry * entries + static_cast<std::int64_t>(sizeof(Index)) * pointers +
         static_cast<std::int64_t>(sizeof(double)) * numbers;
}

// Counts the coordinator's matrix and its sum and, for each block, four matrices of the size of its response:
// those of the best and the current iteration, and two from which one is made. Also counts two copies of the
// problems (lifted blocks, then the monolithic problem) and the solutions of the blocks' newest solves and of
// states that the coordinator may return to.
std::int64_t working_bytes(const CoupledView& view) {
  const auto m = std::ssize(view.coupling_rhs);
  std::int64_t dense = 2 * m * m, copies = 0;
  // Number, from 1, of the last block with this row.
  std::vector<std::size_t> seen(view.coupling_rhs.size(), 0);
  for (std::size_t k = 0; k < view.blocks.size(); ++k) {
    const CoupledBlock& block = view.blocks[k];
    std::int64_t own = 0;
    for (const Index row : block.coupling.row_indices)
      if (std::exchange(seen[at(row)], k + 1) != k + 1) ++own;
    dense += 4 * own * own;
    const ProblemView& p = block.problem;
    const std::int64_t numbers = std::ssize(p.g) + std::ssize(p.b) + std::ssize(p.d) + 2 * std::ssize(p.l);
    copies += 2 * (copy_bytes(p) + 12 * std::ssize(block.coupling.values)) +
              tuning::coupled_answers * static_cast<std::int64_t>(sizeof(double)) * (numbers + own);
  }
  return dense * static_cast<std::int64_t>(sizeof(double)) + copies;
}

bool stopped(const Coordination& coordination) {
  return coordination.status == Status::cancelled || coordination.status == Status::time_limit;
}

double sum_of_objectives(const Coordination& coordination) {
  double sum = 0.0;
  for (const BlockAnswer& answer : coordination.answers) sum += answer.objective;
  return sum;
}

Expected<Solution> solve_from(const Problem& problem, Solution start, const Coordination& coordination,
                              const CoupledOptions& options, const CoupledControls& controls) {
  // If the blocks do not agree, their objective has no meaning.
  start.reference_objective = coordination.status == Status::solved ? sum_of_objectives(coordination)
                                                                    : std::numeric_limits<double>::max();
  start.factorizations = 0;
  auto solver = Solver::create(problem, options.options, setup_of(controls, options.options));
  if (!solver && !ends_early(solver.error())) return unexpected(solver.error());
  if (solver && options.monolithic_search && !stopped(coordination)) {
    CoupledControls beside = controls;
    beside.setup.most_bytes -= std::min(beside.setup.most_bytes, solver->memory_bytes());
    start = search_near(problem, std::move(start), options.options, beside);
  }
  const int searched = start.factorizations;
  const SolveControls how{.stop = controls.stop,
                          .warm_start = &start,
                          .runner = controls.runner,
                          .pause = controls.pause,
                          .begun = controls.begun};
  MARBLE_ASSIGN_OR_RETURN(auto solution,
                          solver ? solver->solve(how) : solve_once(problem, options.options, how));
  solution.factorizations += searched;
  if (solution.status == Status::infeasible) {
    solution.detail =
        "each block has an answer by itself, but not with the coupling rows: " + std::move(solution.detail);
  }
  solution.detail += "; " + coordination.detail;
  return solution;
}

Expected<CoupledSolution> finish_coupled(const CoupledView& view, Coordination coordination,
                                         const CoupledOptions& options, const CoupledControls& controls) {
  CoupledSolution result;
  result.places = monolithic_places(view);
  result.blocks_objective = sum_of_objectives(coordination);
  // That is proved of all blocks only if a point of the whole has the block's ray; the monolithic solve
  // decides.
  const bool has_ray = coordination.failed_block && coordination.status == Status::unbounded;
  const bool block_decides = coordination.failed_block && !has_ray;
  if (has_ray) coordination.status = Status::numerical_failure;
  Solution start = stacked(coordination);
  if (!stopped(coordination) && (block_decides || !options.monolithic)) {
    result.monolithic = std::move(start);
    result.monolithic.status = coordination.status;
    result.monolithic.detail = coordination.detail;
    result.monolithic.objective = result.monolithic.reference_objective = result.blocks_objective;
    report_by_blocks(view, coordination, result.monolithic);
    if (block_decides) {
      const std::size_t k = *coordination.failed_block;
      result.monolithic.certificate = widened(view, result.places, k, coordination.answers[k].solution);
      result.monolithic.proved = coordination.status == Status::infeasible;
      if (result.monolithic.proved) result.monolithic.bound = std::numeric_limits<double>::infinity();
    }
  } else {
    const OwnedProblem monolithic = monolithic_problem(view);
    MARBLE_ASSIGN_OR_RETURN(const auto problem, Problem::create(monolithic.view()));
    MARBLE_ASSIGN_OR_RETURN(result.monolithic,
                            solve_from(problem, std::move(start), coordination, options, controls));
    if (has_ray && result.monolithic.status != Status::unbounded) coordination.failed_block.reset();
  }
  result.coordination = std::move(coordination);
  return result;
}

Expected<CoupledSolution> solve_coupled(const CoupledView& view, const CoupledOptions& options,
                                        const CoupledControls& controls) {
  MARBLE_RETURN_IF_ERROR(check(view));
  MARBLE_RETURN_IF_ERROR(options.check());
  if (controls.start != nullptr) {
    MARBLE_RETURN_IF_ERROR(check_start(view, *controls.start));
  }
  CoupledControls own = controls;
  if (!own.begun) own.begun = Interrupt::now(own.pause);
  return or_out_of_memory([&]() -> Expected<CoupledSolution> {
    MARBLE_RETURN_IF_ERROR(charge(own, working_bytes(view), "blocks"));
    // The blocks' solvers are destroyed before the monolithic one is created.
    auto coordination = [&] {
      LiftedBlocks blocks(view, options, own);
      return coordinate(blocks, view.coupling_rhs, options, own);
    }();
    if (!coordination) return unexpected(coordination.error());
    return finish_coupled(view, *std::move(coordination), options, own);
  });
}

}  // namespace marble
