#include "marble/composite/lifted_block.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

#include "composite/dense.h"
#include "model/column_builder.h"
#include "model/entries.h"
#include "model/interrupt.h"
#include "model/tuning.h"

namespace marble {
namespace {

SparseMatrix widened(const SparseMatrixView& m, Index columns) {
  if (m.rows == 0) return {};
  SparseMatrix wide{m.rows,
                    columns,
                    {m.column_pointers.begin(), m.column_pointers.end()},
                    {m.row_indices.begin(), m.row_indices.end()},
                    {m.values.begin(), m.values.end()}};
  wide.column_pointers.resize(at(columns) + 1, static_cast<Index>(wide.values.size()));
  return wide;
}

std::vector<double> copied(std::span<const double> values) { return {values.begin(), values.end()}; }

}  // namespace

LiftedBlock::LiftedBlock(const CoupledBlock& block)
    : name_(block.name),
      block_(block.problem),
      coupling_(block.coupling),
      n_(static_cast<Index>(block.problem.g.size())),
      n_e_(static_cast<Index>(block.problem.b.size())),
      n_i_(static_cast<Index>(block.problem.d.size())),
      rows_(coupling_.row_indices.begin(), coupling_.row_indices.end()) {
  std::ranges::sort(rows_);
  rows_.erase(std::unique(rows_.begin(), rows_.end()), rows_.end());
  rows_.shrink_to_fit();
  lift();
}

Index LiftedBlock::local(Index row) const {
  return static_cast<Index>(std::ranges::lower_bound(rows_, row) - rows_.begin());
}

void LiftedBlock::lift() {
  const auto m = static_cast<Index>(rows_.size());
  const Index columns = n_ + m, frozen_pairs = static_cast<Index>(side_.size());
  OwnedProblem p;
  p.hessian_form = block_.hessian_form;
  p.c0 = block_.c0;
  ColumnBuilder Q(columns, at(columns)), A(n_e_ + m + frozen_pairs, at(columns)),
      C(n_i_ + frozen_pairs, at(columns));
  pair_entries_.clear();
  for (Index j = 0; j < n_; ++j) {
    Q.add_column(block_.Q, j), A.add_column(block_.A, j), C.add_column(block_.C, j);
    for_column(coupling_, j, [&](Index row, double value) { A.add(n_e_ + local(row), value); });
    if (frozen_pairs > 0) {
      std::vector<std::pair<Index, std::pair<double, double>>> both;
      for_column(block_.L, j, [&](Index row, double value) { both.push_back({row, {value, 0.0}}); });
      for_column(block_.R, j, [&](Index row, double value) {
        const auto there = std::ranges::find(both, row, [](const auto& entry) { return entry.first; });
        if (there != both.end()) {
          there->second.second = value;
        } else {
          both.push_back({row, {0.0, value}});
        }
      });
      std::ranges::sort(both, {}, [](const auto& entry) { return entry.first; });
      for (const auto& [pair, numbers] : both)
        pair_entries_.push_back(
            {pair, A.add(n_e_ + m + pair, 0.0), C.add(n_i_ + pair, 0.0), numbers.first, numbers.second});
    }
    Q.end_column(), A.end_column(), C.end_column();
  }
  for (Index i = 0; i < m; ++i) {
    Q.add(n_ + i, proximal_);
    A.add(n_e_ + i, -1.0);
    Q.end_column(), A.end_column(), C.end_column();
  }
  p.Q = Q.take(), p.A = A.take(), p.C = C.take();
  p.g = copied(block_.g), p.b = copied(block_.b), p.d = copied(block_.d);
  p.g.resize(at(columns), 0.0);
  if (!lifted_.g.empty()) std::copy(lifted_.g.begin() + n_, lifted_.g.end(), p.g.begin() + n_);
  p.b.resize(at(n_e_ + m + frozen_pairs), 0.0);
  p.d.resize(at(n_i_ + frozen_pairs), 0.0);
  if (!frozen_) {
    p.L = widened(block_.L, columns), p.R = widened(block_.R, columns);
    p.l = copied(block_.l), p.r = copied(block_.r);
  }
  lifted_ = std::move(p);
  write_sides();
}

void LiftedBlock::write_sides() {
  for (const Entry& entry : pair_entries_) {
    const bool s_fixed = side_[at(entry.row)] != 0;
    lifted_.A.values[entry.in_A] = s_fixed ? entry.s : entry.t;
    lifted_.C.values[entry.in_C] = s_fixed ? entry.t : entry.s;
  }
  for (std::size_t pair = 0; pair < side_.size(); ++pair) {
    const bool s_fixed = side_[pair] != 0;
    lifted_.b[at(n_e_) + rows_.size() + pair] = s_fixed ? block_.l[pair] : block_.r[pair];
    lifted_.d[at(n_i_) + pair] = s_fixed ? block_.r[pair] : block_.l[pair];
  }
}

Solution LiftedBlock::lifted(const Solution& own, std::span<const double> coupling_multipliers) const {
  Solution solution = own;
  solution.z.resize(at(n_) + rows_.size(), 0.0);
  for (Index j = 0; j < n_; ++j)
    for_column(coupling_, j,
               [&](Index row, double value) { solution.z[at(n_ + local(row))] += value * own.z[at(j)]; });
  for (const Index row : rows_) solution.equality_multipliers.push_back(coupling_multipliers[at(row)]);
  return solution;
}

Solution LiftedBlock::freeze(const Solution& answer) {
  std::vector<double> s = copied(block_.l), t = copied(block_.r);
  for (Index j = 0; j < n_; ++j) {
    for_column(block_.L, j, [&](Index row, double value) { s[at(row)] += value * answer.z[at(j)]; });
    for_column(block_.R, j, [&](Index row, double value) { t[at(row)] += value * answer.z[at(j)]; });
  }
  side_.resize(s.size());
  for (std::size_t pair = 0; pair < s.size(); ++pair) {
    side_[pair] = s[pair] - std::abs(answer.complementarity_multipliers_L[pair]) <
                  t[pair] - std::abs(answer.complementarity_multipliers_R[pair]);
  }
  frozen_ = true;
  lift();
  Solution same = answer;
  for (std::size_t pair = 0; pair < side_.size(); ++pair) {
    const double xi = answer.complementarity_multipliers_L[pair];
    const double eta = answer.complementarity_multipliers_R[pair];
    same.equality_multipliers.push_back(side_[pair] != 0 ? -xi : -eta);
    same.inequality_multipliers.push_back(side_[pair] != 0 ? eta : xi);
  }
  same.complementarity_multipliers_L.clear();
  same.complementarity_multipliers_R.clear();
  return same;
}

void LiftedBlock::switch_pair(Index pair) {
  side_[at(pair)] ^= 1U;
  sides_changed_ = true;
}

void LiftedBlock::ask(const BlockAsk& ask) {
  if (std::exchange(proximal_, ask.proximal) != ask.proximal) {
    std::fill(lifted_.Q.values.end() - static_cast<std::ptrdiff_t>(rows_.size()), lifted_.Q.values.end(),
              proximal_);
    proximal_changed_ = true;
  }
  for (std::size_t i = 0; i < rows_.size(); ++i)
    lifted_.g[at(n_) + i] = ask.price[i] - proximal_ * ask.centre[i];
}

ProblemUpdate LiftedBlock::update() {
  ProblemUpdate update{.g = lifted_.g};
  if (std::exchange(proximal_changed_, false)) update.Q = lifted_.Q.values;
  if (std::exchange(sides_changed_, false)) {
    write_sides();
    update.A = lifted_.A.values, update.C = lifted_.C.values;
    update.b = lifted_.b, update.d = lifted_.d;
  }
  return update;
}

double LiftedBlock::objective(std::span<const double> z) const {
  double sum = block_.c0;
  const bool upper = block_.hessian_form == HessianForm::upper_triangle;
  for (Index j = 0; j < n_; ++j) {
    sum += block_.g[at(j)] * z[at(j)];
    for_column(block_.Q, j, [&](Index row, double value) {
      const double twice = upper && row != j ? 2.0 : 1.0;
      sum += twice * value * z[at(row)] * z[at(j)] / 2.0;
    });
  }
  return sum;
}

// Removes v and the rows that define it. A frozen pair's multipliers are those of its two rows.
Solution LiftedBlock::own(Solution lifted) const {
  Solution solution = std::move(lifted);
  solution.z.resize(at(n_));
  if (frozen()) {
    const std::size_t first = at(n_e_) + rows_.size();
    for (std::size_t pair = 0; pair < side_.size(); ++pair) {
      const double fixed = -solution.equality_multipliers[first + pair];
      const double free = solution.inequality_multipliers[at(n_i_) + pair];
      solution.complementarity_multipliers_L.push_back(side_[pair] != 0 ? fixed : free);
      solution.complementarity_multipliers_R.push_back(side_[pair] != 0 ? free : fixed);
    }
  }
  solution.equality_multipliers.resize(at(n_e_));
  solution.inequality_multipliers.resize(at(n_i_));
  solution.objective = objective(solution.z);
  return solution;
}

BlockAnswer LiftedBlock::answer(Solution lifted, std::vector<double> proximal_response,
                                const SetupControls& ends) const {
  BlockAnswer answer;
  answer.status = lifted.status;
  answer.detail = lifted.detail;
  answer.factorizations = lifted.factorizations;
  answer.value.assign(lifted.z.begin() + n_, lifted.z.end());
  const std::size_t m = rows_.size();
  if (is_solved(lifted.status)) {
    if (!proximal_response.empty())
      answer.response = without_proximal(std::move(proximal_response), m, proximal_, ends);
    if (answer.response.empty()) {  // T = ½/ρ, so S = 1/ρ
      answer.response.assign(m * m, 0.0);
      for (std::size_t i = 0; i < m; ++i) answer.response[i * m + i] = 1.0 / proximal_;
    }
  }
  answer.solution = own(std::move(lifted));
  answer.objective = answer.solution.objective;
  for (std::size_t pair = 0; pair < side_.size(); ++pair) {
    const Solution& own = answer.solution;
    const double xi = own.complementarity_multipliers_L[pair], eta = own.complementarity_multipliers_R[pair];
    const double fixed = side_[pair] != 0 ? xi : eta, free = side_[pair] != 0 ? eta : xi;
    // The multiplier of the free side shows that it is at zero, and that of the fixed side has the wrong
    // sign.
    if (fixed < -tuning::near && free > tuning::near)
      answer.pulls.push_back({static_cast<Index>(pair), -fixed});
  }
  return answer;
}

Expected<std::vector<double>> LiftedResponse::at(const LiftedBlock& block, const ProblemUpdate& update,
                                                 const Solution& answer, const Create& create,
                                                 const SetupControls& ends) {
  using Response = std::vector<double>;
  const Interrupt interrupt(ends.stop, ends.until, ends.pause);
  if (sensitivity_) {
    if (!sensitivity_->renew(update, answer)) return Response();
  } else {
    const auto problem = Problem::create(block.problem().view());
    if (!problem) return Response();
    auto made = create ? create(*problem, answer) : Sensitivity::create(*problem, answer);
    if (!made && made.error().code == ErrorCode::resource_exhausted) return unexpected(made.error());
    if (!made) return Response();
    sensitivity_.emplace(*std::move(made));
  }
  const std::size_t m = block.rows().size(), n = marble::at(block.variables());
  std::vector<double> result, unit(n + m, 0.0);
  result.reserve(m * m);
  for (std::size_t i = 0; i < m; ++i) {
    unit[n + i] = -1.0;
    const auto change = sensitivity_->along({.g = unit});
    unit[n + i] = 0.0;
    if (!change || interrupt.requested()) return Response();
    result.insert(result.end(), change->z.begin() + static_cast<std::ptrdiff_t>(n), change->z.end());
  }
  return result;
}

std::vector<double> without_proximal(std::vector<double> with, std::size_t m, double proximal,
                                     const SetupControls& ends) {
  if (m == 0) return {};
  const auto size = static_cast<Eigen::Index>(m);
  const Interrupt interrupt(ends.stop, ends.until, ends.pause);
  Eigen::Map<Eigen::MatrixXd> response(with.data(), size, size);
  Eigen::MatrixXd vectors = 0.5 * proximal * (response + response.transpose());
  Eigen::VectorXd values;
  if (!eigen_decomposition(vectors, values, interrupt)) return {};
  // T's eigenvalue τ = 1 / (1 + μ) corresponds to the curvature ρμ.
  for (double& tau : values) {
    const double curvature = std::abs(1.0 - tau);
    tau = std::max(0.0, tau) / std::max(curvature, tuning::near) / proximal;
  }
  if (!spectral_product(vectors, values, response, interrupt)) return {};
  return with;
}

}  // namespace marble
