#include "global/linear_rows.h"

#include <algorithm>
#include <cmath>

#include "global/vertex.h"
#include "model/careful_sum.h"
#include "path/termination.h"
#include "proof/proof.h"

namespace marble {

LinearRows::LinearRows(const Problem& problem, const Options& options, const SolveControls& controls,
                       const SetupControls& setup)
    : problem_(problem), setup_(setup), place_(static_cast<std::size_t>(problem.variables()), -1) {
  const double least =
      std::min({options.equality_tolerance, options.inequality_tolerance, options.complementarity_tolerance});
  options_.equality_tolerance = options_.inequality_tolerance = least;
  options_.time_limit_s = options.time_limit_s;
  controls_ = {.stop = controls.stop, .pause = controls.pause, .begun = controls.begun};
  tolerances_ = {options.equality_tolerance, options.inequality_tolerance, options.complementarity_tolerance};
  const ProblemView& view = problem.view();
  rows_.columns = problem.variables();
  append_rows(view.A, problem.equalities(), rows_);
  append_rows(view.C, problem.inequalities(), rows_);
  append_rows(view.L, problem.pairs(), rows_);
  append_rows(view.R, problem.pairs(), rows_);
  offset_.resize(rows_.rows);
  Index at = 0;
  for (const std::span<const double> part : {view.b, view.d, view.l, view.r}) {
    for (const double value : part) offset_[at++] = value;
  }
  z_ = Vector::Zero(problem.variables());
}

double LinearRows::tolerance(Index row) const {
  if (row < problem_.equalities()) return tolerances_[0];
  return row < problem_.equalities() + problem_.inequalities() ? tolerances_[1] : tolerances_[2];
}

double LinearRows::value(Index row, ConstVectorRef z) const {
  CarefulSum sum;
  sum.add(offset_[row], 1.0);
  for (Index k = rows_.row_pointers[row]; k < rows_.row_pointers[row + 1]; ++k)
    sum.add(rows_.values[k], z[rows_.column_indices[k]]);
  return sum.value();
}

// Returns the problem of the point nearest to 0 in the variables of the rows; at least one variable.
OwnedProblem LinearRows::program(std::span<const HeldRow> rows) {
  for (const Index column : columns_) place_[column] = -1;
  columns_.clear();
  Triplets equalities, inequalities;
  OwnedProblem p;
  for (const HeldRow& held : rows) {
    Triplets& entries = held.equality ? equalities : inequalities;
    std::vector<double>& offsets = held.equality ? p.b : p.d;
    for (Index k = rows_.row_pointers[held.row]; k < rows_.row_pointers[held.row + 1]; ++k) {
      Index& place = place_[rows_.column_indices[k]];
      if (place < 0) {
        place = static_cast<Index>(columns_.size());
        columns_.push_back(rows_.column_indices[k]);
      }
      entries.add(static_cast<Index>(offsets.size()), place, rows_.values[k]);
    }
    offsets.push_back(offset_[held.row]);
  }
  const auto n = static_cast<Index>(std::max<std::size_t>(columns_.size(), 1));
  p.g.assign(static_cast<std::size_t>(n), 0.0);
  Triplets distance;
  for (Index j = 0; j < n; ++j) distance.add(j, j, 1.0);
  p.Q = compress(n, n, distance, "Q").value();
  p.A = compress(static_cast<Index>(p.b.size()), n, equalities, "A").value();
  p.C = compress(static_cast<Index>(p.d.size()), n, inequalities, "C").value();
  return p;
}

// Converts (y, ν). Returns false if a point within the tolerances may still exist: a smaller contradiction is
// no conflict for a user who chose these tolerances.
bool LinearRows::take_multipliers(std::span<const HeldRow> rows, std::span<const double> stacked) {
  multipliers_.clear();
  std::size_t equality = 0, inequality = 0;
  for (const HeldRow& held : rows) inequality += held.equality ? 1 : 0;
  double within = 0.0;
  for (const HeldRow& held : rows) {
    multipliers_.push_back(held.equality ? stacked[equality++] : 0.0 - stacked[inequality++]);
    within += tolerance(held.row) * std::abs(multipliers_.back());
  }
  return within < 1.0;
}

bool LinearRows::take_point(std::span<const HeldRow> rows, std::span<const double> z) {
  z_.setZero();
  for (std::size_t j = 0; j < columns_.size(); ++j) z_[columns_[j]] = z[j];
  return std::ranges::all_of(rows, [this](const HeldRow& held) {
    const double at = value(held.row, z_);
    return at >= -tolerance(held.row) && (!held.equality || at <= tolerance(held.row));
  });
}

LinearRows::End LinearRows::decide(std::span<const HeldRow> rows) {
  multipliers_.clear();
  z_.setZero();
  if (rows.empty()) return End::feasible;
  ++programs_;
  const OwnedProblem owned = program(rows);
  const auto problem = Problem::create(owned.view());
  if (!problem) return End::undecided;  // its sums of duplicate entries are out of range
  bool proved = false;
  {
    Run run(options_, controls_);
    run.bytes_left = static_cast<double>(setup_.most_bytes);
    const ScaledProblem scaled = scale(*problem, options_.scaling_passes, run.interrupt());
    const auto proof = prove_infeasible(scaled, Vector::Zero(problem->variables()), run);
    factorizations_ += run.factorizations;
    iterations_ += run.iterations;
    times_ += run.times;
    if (proof) {
      if (take_multipliers(rows, proof->multipliers)) return End::contradiction;
      proved = true;
    }
    if (run.interrupt().requested()) return End::undecided;
  }
  auto solver = Solver::create(*problem, options_, setup_);
  if (!solver) return End::undecided;
  const auto solution = solver->solve(controls_);
  if (!solution) return End::undecided;
  factorizations_ += solution->factorizations;
  iterations_ += solution->iterations;
  times_ += solution->times;
  if (solution->status == Status::solved && take_point(rows, solution->z)) return End::feasible;
  if (solution->status == Status::infeasible && !solution->certificate.empty()) {
    static_cast<void>(take_multipliers(rows, solution->certificate));
    return End::contradiction;
  }
  return proved && !ended_by_force(solution->status) ? End::contradiction : End::undecided;
}

std::vector<HeldRow> LinearRows::vertex(std::span<const HeldRow> rows) const {
  VertexTableau tableau(rows_, offset_);
  std::vector<HeldRow> kept;
  for (const std::size_t k : tableau.support(rows, multipliers_)) kept.push_back(rows[k]);
  return kept;
}

}  // namespace marble
