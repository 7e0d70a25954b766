#include "coupled/sweep.h"

#include <algorithm>
#include <string>
#include <tuple>
#include <utility>

#include "coupled/finish.h"
#include "model/entries.h"

namespace marble {
namespace {

std::vector<Index> last_stages(std::initializer_list<const SparseMatrixView*> matrices, std::size_t rows,
                               std::span<const Index> stage) {
  std::vector<Index> last(rows, 0);
  for (const SparseMatrixView* m : matrices)
    for_entries(*m,
                [&](Index row, Index j, double) { last[at(row)] = std::max(last[at(row)], stage[at(j)]); });
  return last;
}

class Window {
 public:
  Window(const ProblemView& problem, std::span<const Index> stage)
      : p_(problem),
        stage_(stage),
        equality_stage_(last_stages({&p_.A}, p_.b.size(), stage)),
        inequality_stage_(last_stages({&p_.C}, p_.d.size(), stage)),
        pair_stage_(last_stages({&p_.L, &p_.R}, p_.l.size(), stage)) {}

  /// The variables and rows of the stages [first, end); those before are known. Not whole if interrupted.
  [[nodiscard]] Expected<OwnedProblem> problem(Index first, Index end, const std::vector<double>& z,
                                               const Interrupt& interrupt);
  /// Takes the stages [first, end) of an answer to it over.
  void take(const Solution& answer, Index first, Index end, Solution& whole) const;

 private:
  struct Rows {
    std::vector<Index> kept;   // their numbers in the whole
    std::vector<Index> local;  // −1: none of the window's
  };
  [[nodiscard]] static Rows rows_of(std::span<const Index> stage, Index first, Index end);
  [[nodiscard]] Expected<SparseMatrix> part(const SparseMatrixView& m, const Rows& rows,
                                            const std::vector<double>& z, std::span<const double> offsets,
                                            std::vector<double>& own, const char* name) const;

  ProblemView p_;
  std::span<const Index> stage_;
  std::vector<Index> equality_stage_, inequality_stage_, pair_stage_;
  Rows variables_, equalities_, inequalities_, pairs_;
};

Window::Rows Window::rows_of(std::span<const Index> stage, Index first, Index end) {
  Rows rows;
  rows.local.assign(stage.size(), -1);
  for (std::size_t row = 0; row < stage.size(); ++row) {
    if (stage[row] < first || stage[row] >= end) continue;
    rows.local[row] = static_cast<Index>(rows.kept.size());
    rows.kept.push_back(static_cast<Index>(row));
  }
  return rows;
}

Expected<SparseMatrix> Window::part(const SparseMatrixView& m, const Rows& rows, const std::vector<double>& z,
                                    std::span<const double> offsets, std::vector<double>& own,
                                    const char* name) const {
  for (const Index row : rows.kept) own.push_back(offsets[at(row)]);
  Triplets entries;
  for_entries(m, [&](Index row, Index j, double value) {
    const Index there = rows.local[at(row)], variable = variables_.local[at(j)];
    if (there < 0) return;
    if (variable >= 0) {
      entries.add(there, variable, value);
    } else {
      own[at(there)] += value * z[at(j)];
    }
  });
  return compress(static_cast<Index>(rows.kept.size()), static_cast<Index>(variables_.kept.size()), entries,
                  name);
}

Expected<OwnedProblem> Window::problem(Index first, Index end, const std::vector<double>& z,
                                       const Interrupt& interrupt) {
  variables_ = rows_of(stage_, first, end);
  equalities_ = rows_of(equality_stage_, first, end);
  inequalities_ = rows_of(inequality_stage_, first, end);
  pairs_ = rows_of(pair_stage_, first, end);
  OwnedProblem window;
  window.hessian_form = p_.hessian_form;
  for (const Index j : variables_.kept) window.g.push_back(p_.g[at(j)]);
  Triplets Q;
  for_entries(p_.Q, [&](Index i, Index j, double value) {
    const Index row = variables_.local[at(i)], column = variables_.local[at(j)];
    if (row >= 0 && column >= 0) Q.add(row, column, value);
    if (row >= 0 && column < 0 && stage_[at(j)] < first) window.g[at(row)] += value * z[at(j)];
    const bool mirrored = p_.hessian_form == HessianForm::upper_triangle && i != j;
    if (mirrored && column >= 0 && row < 0 && stage_[at(i)] < first) window.g[at(column)] += value * z[at(i)];
  });
  const auto n = static_cast<Index>(window.g.size());
  auto hessian = compress(n, n, Q, "Q");
  if (!hessian) return unexpected(hessian.error());
  window.Q = *std::move(hessian);
  for (auto& [into, m, rows, offsets, own, name] :
       {std::tuple{&window.A, &p_.A, &equalities_, p_.b, &window.b, "A"},
        std::tuple{&window.C, &p_.C, &inequalities_, p_.d, &window.d, "C"},
        std::tuple{&window.L, &p_.L, &pairs_, p_.l, &window.l, "L"},
        std::tuple{&window.R, &p_.R, &pairs_, p_.r, &window.r, "R"}}) {
    if (interrupt.requested()) return window;  // which is not solved
    auto matrix = part(*m, *rows, z, offsets, *own, name);
    if (!matrix) return unexpected(matrix.error());
    *into = *std::move(matrix);
  }
  return window;
}

void Window::take(const Solution& answer, Index first, Index end, Solution& whole) const {
  const auto scatter = [&](const Rows& rows, std::span<const Index> stage,
                           std::vector<double> Solution::*values) {
    for (std::size_t i = 0; i < rows.kept.size(); ++i) {
      const std::size_t there = at(rows.kept[i]);
      if (stage[there] >= first && stage[there] < end) (whole.*values)[there] = (answer.*values)[i];
    }
  };
  scatter(variables_, stage_, &Solution::z);
  scatter(equalities_, equality_stage_, &Solution::equality_multipliers);
  scatter(inequalities_, inequality_stage_, &Solution::inequality_multipliers);
  scatter(pairs_, pair_stage_, &Solution::complementarity_multipliers_L);
  scatter(pairs_, pair_stage_, &Solution::complementarity_multipliers_R);
}

double objective(const ProblemView& p, const std::vector<double>& z) {
  double sum = p.c0;
  for (std::size_t j = 0; j < z.size(); ++j) sum += p.g[j] * z[j];
  const bool upper = p.hessian_form == HessianForm::upper_triangle;
  for_entries(p.Q, [&](Index i, Index j, double value) {
    sum += (upper && i != j ? 1.0 : 0.5) * value * z[at(i)] * z[at(j)];
  });
  return sum;
}

}  // namespace

Expected<Solution> sweep(const Problem& problem, std::span<const Index> stage_of_variable,
                         std::span<const Index> piece_of_variable, const PiecesOptions& options,
                         const CoupledControls& controls) {
  const Index stages = *std::ranges::max_element(stage_of_variable) + 1;
  std::vector<Index> ends(at(options.pieces), 0);
  for (std::size_t j = 0; j < piece_of_variable.size(); ++j) {
    Index& end = ends[at(piece_of_variable[j])];
    end = std::max(end, stage_of_variable[j] + 1);
  }
  const ProblemView& p = problem.view();
  Solution whole;
  whole.status = Status::solved;
  whole.z.assign(p.g.size(), 0.0);
  whole.equality_multipliers.assign(p.b.size(), 0.0);
  whole.inequality_multipliers.assign(p.d.size(), 0.0);
  whole.complementarity_multipliers_L.assign(p.l.size(), 0.0);
  whole.complementarity_multipliers_R.assign(p.l.size(), 0.0);
  Window window(p, stage_of_variable);
  const Interrupt interrupt = interrupt_of(controls, options.coupled.options);
  Index first = 0;
  for (std::size_t k = 0; k < ends.size(); ++k) {
    const Index ahead = options.look_ahead >= 0 ? options.look_ahead : std::max(2, (ends[k] - first) / 3);
    const Index end = ends[k] + std::min(ahead, stages - ends[k]);
    const auto ended = [&]() -> bool {
      if (!interrupt.requested()) return false;
      whole.status = interrupt.stop_requested() ? Status::cancelled : Status::time_limit;
      whole.detail = "ended at piece " + std::to_string(k);
      return true;
    };
    if (ended()) return whole;
    const auto part = window.problem(first, end, whole.z, interrupt);
    if (ended()) return whole;
    if (!part) return unexpected(part.error());
    const auto checked = Problem::create(part->view());
    if (!checked) return unexpected(checked.error());
    const auto answer = solve_once(
        *checked, options.coupled.options,
        {.stop = controls.stop, .runner = controls.runner, .begun = controls.begun}, controls.setup);
    if (!answer) return unexpected(answer.error());
    whole.factorizations += answer->factorizations;
    if (!is_solved(answer->status)) {
      whole.status = answer->status;
      whole.detail = "piece " + std::to_string(k) + ", from where the last one ended: " + answer->detail;
      return whole;
    }
    window.take(*answer, first, ends[k], whole);
    first = ends[k];
  }
  whole.objective = objective(p, whole.z);
  return whole;
}

}  // namespace marble
