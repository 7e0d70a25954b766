#include "composite/stages.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "model/column_builder.h"
#include "model/text_of.h"

namespace marble {
namespace {

template <class Values>
std::span<const double> given_or(const Values& given, std::span<const double> base) {
  return given.empty() ? base : std::span<const double>(given);
}

double at(std::span<const double> values, Index i) { return values[static_cast<std::size_t>(i)]; }

// Marks the entries of a list, which must ascend strictly within [0, size).
Expected<std::vector<char>> marks(std::span<const Index> list, Index size, const char* field) {
  std::vector<char> marked(static_cast<std::size_t>(size), 0);
  for (std::size_t i = 0; i < list.size(); ++i) {
    const auto refuse = [&](const std::string& bound) {
      return unexpected(invalid(field, static_cast<std::int64_t>(i), std::to_string(list[i]), bound));
    };
    if (list[i] < 0 || list[i] >= size) return refuse("must be in [0, " + std::to_string(size) + ")");
    if (i > 0 && list[i] <= list[i - 1]) return refuse("must be above the entry before it");
    marked[static_cast<std::size_t>(list[i])] = 1;
  }
  return marked;
}

Split split(std::vector<char> second) {
  Split result;
  result.place.reserve(second.size());
  for (std::size_t i = 0; i < second.size(); ++i) {
    std::vector<Index>& side = second[i] ? result.second : result.first;
    result.place.push_back(static_cast<Index>(side.size()));
    side.push_back(static_cast<Index>(i));
  }
  result.is_second = std::move(second);
  return result;
}

// Marks rows with an entry in a second-stage column as second-stage rows.
void mark_rows(const SparseMatrixView& matrix, const std::vector<char>& second_columns,
               std::vector<char>& second_rows) {
  for (std::size_t j = 0; j + 1 < matrix.column_pointers.size(); ++j) {
    if (!second_columns[j]) continue;
    for (Index k = matrix.column_pointers[j]; k < matrix.column_pointers[j + 1]; ++k)
      second_rows[static_cast<std::size_t>(matrix.row_indices[static_cast<std::size_t>(k)])] = 1;
  }
}

// Collects entries by columns, in compressed form, with ascending rows in each column.
class BlockBuilder {
 public:
  explicit BlockBuilder(std::size_t columns) : columns_(columns) {}
  void add(Index row, Index column, Index position) {
    columns_[static_cast<std::size_t>(column)].emplace_back(row, position);
  }
  [[nodiscard]] Block block() {
    Block result;
    result.pointers.push_back(0);
    for (auto& column : columns_) {
      std::ranges::sort(column);
      for (const auto& [row, position] : column) {
        result.rows.push_back(row);
        result.positions.push_back(position);
      }
      result.pointers.push_back(static_cast<Index>(result.rows.size()));
    }
    return result;
  }

 private:
  std::vector<std::vector<std::pair<Index, Index>>> columns_;
};

template <class Visit>
void each_entry(const SparseMatrixView& matrix, const Visit& visit) {
  for (std::size_t j = 0; j + 1 < matrix.column_pointers.size(); ++j)
    for (Index k = matrix.column_pointers[j]; k < matrix.column_pointers[j + 1]; ++k)
      visit(matrix.row_indices[static_cast<std::size_t>(k)], static_cast<Index>(j), k);
}

MatrixStages stages_of(const SparseMatrixView& matrix, const Split& rows, const Split& variables) {
  BlockBuilder first(variables.first.size()), linking(variables.first.size()),
      recourse(variables.second.size());
  each_entry(matrix, [&](Index i, Index j, Index position) {
    const Index row = rows.place[static_cast<std::size_t>(i)];
    const Index column = variables.place[static_cast<std::size_t>(j)];
    const bool second_row = rows.is_second[static_cast<std::size_t>(i)] != 0;
    const bool second_column = variables.is_second[static_cast<std::size_t>(j)] != 0;
    (second_column ? recourse : (second_row ? linking : first)).add(row, column, position);
  });
  return {first.block(), linking.block(), recourse.block()};
}

// Uses only entries with row ≤ column.
MatrixStages hessian_stages(const SparseMatrixView& matrix, const Split& variables) {
  BlockBuilder first(variables.first.size()), linking(variables.second.size()),
      recourse(variables.second.size());
  each_entry(matrix, [&](Index i, Index j, Index position) {
    if (i > j) return;
    const Index row = variables.place[static_cast<std::size_t>(i)];
    const Index column = variables.place[static_cast<std::size_t>(j)];
    const bool second_row = variables.is_second[static_cast<std::size_t>(i)] != 0;
    const bool second_column = variables.is_second[static_cast<std::size_t>(j)] != 0;
    if (second_row == second_column) {
      (second_row ? recourse : first).add(row, column, position);
    } else if (second_column) {
      linking.add(row, column, position);
    } else {
      linking.add(column, row, position);
    }
  });
  return {first.block(), linking.block(), recourse.block()};
}

std::vector<double> gather(std::span<const double> values, std::span<const Index> list) {
  std::vector<double> result;
  result.reserve(list.size());
  for (const Index i : list) result.push_back(at(values, i));
  return result;
}

void append_column(const Block& block, std::size_t column, Index first_row, std::span<const double> values,
                   double factor, ColumnBuilder& into) {
  for (Index k = block.pointers[column]; k < block.pointers[column + 1]; ++k)
    into.add(first_row + block.rows[marble::at(k)], factor * at(values, block.positions[marble::at(k)]));
}

std::size_t entries(const Block& block) { return block.rows.size(); }

// Adds A x to `result`, for a block whose columns are those of x.
void add_product(const Block& block, std::span<const double> values, std::span<const double> x,
                 std::span<double> result) {
  for (std::size_t j = 0; j + 1 < block.pointers.size(); ++j)
    for (Index k = block.pointers[j]; k < block.pointers[j + 1]; ++k) {
      const auto entry = static_cast<std::size_t>(k);
      result[static_cast<std::size_t>(block.rows[entry])] += at(values, block.positions[entry]) * x[j];
    }
}

std::vector<Index> sorted(std::span<const Index> list) {
  std::vector<Index> result(list.begin(), list.end());
  std::ranges::sort(result);
  return result;
}

Expected<void> check_same(std::span<const double> given, std::span<const double> base, Index position,
                          const std::string& field) {
  if (given.empty() || at(given, position) == at(base, position)) return {};
  return unexpected(invalid(field, position, text_of(at(given, position)),
                            "must be " + text_of(at(base, position)) +
                                ", as the base has it: it is of a row of first-stage variables alone; name "
                                "the row in own_equalities, own_inequalities or own_pairs"));
}

}  // namespace

// Common description of the parts A, C, L and R.
struct Stages::Part {
  ProblemPart matrix_part, offset_part;
  const char* matrix_name;
  const char* offset_name;
  const MatrixStages& stages;
  const Split& rows;
  const SparseMatrixView& matrix;
  std::span<const double> offset;
  std::vector<double> ScenarioNumbers::*values;
  std::vector<double> ScenarioNumbers::*offsets;
  SparseMatrix OwnedProblem::*into;
  std::vector<double> OwnedProblem::*offset_into;
};

template <class Visit>
void Stages::each_part(const Visit& visit) const {
  const ProblemView& view = base_.view();
  using N = ScenarioNumbers;
  using P = OwnedProblem;
  using enum ProblemPart;
  visit(Part{A, b, "A.values", "b", A_, equalities, view.A, view.b, &N::A, &N::b, &P::A, &P::b});
  visit(Part{C, d, "C.values", "d", C_, inequalities, view.C, view.d, &N::C, &N::d, &P::C, &P::d});
  visit(Part{L, l, "L.values", "l", L_, pairs, view.L, view.l, &N::L, &N::l, &P::L, &P::l});
  visit(Part{R, r, "R.values", "r", R_, pairs, view.R, view.r, &N::R, &N::r, &P::R, &P::r});
}

Expected<Stages> Stages::create(const ScenarioProblem& problem) {
  auto base = Problem::create(problem.base);
  if (!base) return unexpected(inside("base", base.error()));
  MARBLE_ASSIGN_OR_RETURN(auto plan, marks(problem.first_stage, base->variables(), "first_stage"));
  if (problem.first_stage.empty()) return unexpected(invalid("first_stage", "must name a variable at least"));
  if (problem.first_stage.size() == plan.size())
    return unexpected(invalid("first_stage", "must leave a variable to the recourse"));
  if (!problem.sample) return unexpected(invalid("sample", "must be there"));
  if (problem.scenarios < 1)
    return unexpected(invalid("scenarios", std::to_string(problem.scenarios), "must be >= 1"));
  std::vector<char> second(plan.size());
  std::ranges::transform(plan, second.begin(), [](char of_plan) { return of_plan ? 0 : 1; });
  MARBLE_ASSIGN_OR_RETURN(auto equalities,
                          marks(problem.own_equalities, base->equalities(), "own_equalities"));
  MARBLE_ASSIGN_OR_RETURN(auto inequalities,
                          marks(problem.own_inequalities, base->inequalities(), "own_inequalities"));
  MARBLE_ASSIGN_OR_RETURN(auto pairs, marks(problem.own_pairs, base->pairs(), "own_pairs"));
  const ProblemView& view = base->view();
  mark_rows(view.A, second, equalities);
  mark_rows(view.C, second, inequalities);
  mark_rows(view.L, second, pairs);
  mark_rows(view.R, second, pairs);
  Stages stages(*base);
  stages.variables = split(std::move(second));
  stages.equalities = split(std::move(equalities));
  stages.inequalities = split(std::move(inequalities));
  stages.pairs = split(std::move(pairs));
  stages.Q_ = hessian_stages(view.Q, stages.variables);
  stages.A_ = stages_of(view.A, stages.equalities, stages.variables);
  stages.C_ = stages_of(view.C, stages.inequalities, stages.variables);
  stages.L_ = stages_of(view.L, stages.pairs, stages.variables);
  stages.R_ = stages_of(view.R, stages.pairs, stages.variables);
  return stages;
}

Expected<void> Stages::check(const ScenarioNumbers& numbers) const {
  MARBLE_RETURN_IF_ERROR(PartSizes::of(base_).check(numbers.update()));
  if (!std::isfinite(numbers.weight) || numbers.weight <= 0.0)
    return unexpected(invalid("weight", text_of(numbers.weight), "must be finite and > 0"));
  Expected<void> valid;
  each_part([&](const Part& part) {
    for (const Index row : part.rows.first)
      if (valid) valid = check_same(numbers.*part.offsets, part.offset, row, part.offset_name);
    for (const Index position : part.stages.first.positions)
      if (valid) valid = check_same(numbers.*part.values, part.matrix.values, position, part.matrix_name);
  });
  return valid;
}

std::optional<std::size_t> Stages::fixed_among(const ScenarioEntries& entries) const {
  std::optional<std::size_t> result;
  const auto look = [&](std::span<const Index> fixed) {
    std::size_t k = 0;
    for (const Index position : sorted(fixed)) {
      if (entries.positions.empty()) {
        result = static_cast<std::size_t>(position);
        return;
      }
      while (k < entries.positions.size() && entries.positions[k] < position) ++k;
      if (k == entries.positions.size()) return;
      if (entries.positions[k] != position) continue;
      result = k;
      return;
    }
  };
  each_part([&](const Part& part) {
    if (entries.part == part.offset_part) look(part.rows.first);
    if (entries.part == part.matrix_part) look(part.stages.first.positions);
  });
  return result;
}

SolverSizes Stages::assembled_sizes(double scenarios) const {
  const auto rows = [scenarios](const Split& split) {
    return static_cast<double>(split.first.size()) + scenarios * static_cast<double>(split.second.size());
  };
  SolverSizes sizes{.variables = rows(variables),
                    .equalities = rows(equalities),
                    .inequalities = rows(inequalities),
                    .pairs = rows(pairs)};
  for (const MatrixStages* matrix : {&Q_, &A_, &C_, &L_, &R_})
    sizes.entries += static_cast<double>(entries(matrix->first)) +
                     scenarios * static_cast<double>(entries(matrix->linking) + entries(matrix->recourse));
  return sizes;
}

double Stages::assembled_bytes(double scenarios) const {
  const SolverSizes sizes = assembled_sizes(scenarios);
  const double vectors = sizes.variables + sizes.equalities + sizes.inequalities + 2.0 * sizes.pairs;
  const double mean = static_cast<double>(base_.view().Q.values.size());
  return sizes.entries * (sizeof(double) + sizeof(Index)) + 5.0 * (sizes.variables + 1.0) * sizeof(Index) +
         (vectors + mean) * sizeof(double) + sizeof(OwnedProblem);
}

double Stages::answer_bytes(double scenarios) const {
  const SolverSizes sizes = assembled_sizes(scenarios);
  return (sizes.variables + sizes.equalities + sizes.inequalities + 2.0 * sizes.pairs) * sizeof(double);
}

double Stages::part_bytes() const {
  const std::size_t numbers = variables.second.size() + equalities.second.size() +
                              inequalities.second.size() + 2 * pairs.second.size();
  return static_cast<double>(sizeof(Solution) + numbers * sizeof(double));
}

Expected<OwnedProblem> Stages::assemble(std::span<const ScenarioNumbers> scenarios,
                                        std::span<const double> weights, const Interrupt& interrupt) const {
  const ProblemView& view = base_.view();
  const std::size_t count = scenarios.size();
  const std::size_t plan = variables.first.size();
  const std::size_t own = variables.second.size();
  OwnedProblem result;
  result.hessian_form = HessianForm::upper_triangle;
  result.g = gather(view.g, variables.first);
  std::ranges::fill(result.g, 0.0);
  result.g.reserve(variables.assembled(count));
  bool too_many = variables.assembled(count) > static_cast<std::size_t>(std::numeric_limits<Index>::max());
  Checkpoint checkpoint(interrupt);
  bool stopped = false;
  const auto stops_after = [&](std::size_t numbers) {
    return stopped = stopped || checkpoint.reached(static_cast<std::int64_t>(numbers) + 1);
  };
  const std::size_t base_entries = view.Q.values.size();
  for (std::size_t s = 0; s < count && !stops_after(plan + own); ++s) {
    const auto g = given_or(scenarios[s].g, view.g);
    for (std::size_t i = 0; i < plan; ++i) result.g[i] += weights[s] * at(g, variables.first[i]);
    for (const Index j : variables.second) result.g.push_back(weights[s] * at(g, j));
    result.c0 += weights[s] * scenarios[s].c0.value_or(view.c0);
  }
  const auto fits = [&](std::size_t size) {
    too_many = too_many || size > static_cast<std::size_t>(std::numeric_limits<Index>::max());
    return !too_many;
  };
  const auto size_of = [&](const MatrixStages& stages) {
    return entries(stages.first) + count * (entries(stages.linking) + entries(stages.recourse));
  };

  if (fits(size_of(Q_))) {
    ColumnBuilder Q(static_cast<Index>(result.g.size()), result.g.size(), size_of(Q_));
    std::vector<double> mean(base_entries, 0.0);
    for (std::size_t s = 0; s < count && !stops_after(entries(Q_.first)); ++s) {
      const auto values = given_or(scenarios[s].Q, view.Q.values);
      for (const Index position : Q_.first.positions)
        mean[static_cast<std::size_t>(position)] += weights[s] * at(values, position);
    }
    for (std::size_t j = 0; j < plan; ++j) {
      append_column(Q_.first, j, 0, mean, 1.0, Q);
      Q.end_column();
    }
    for (std::size_t s = 0; s < count && !stops_after(own + base_entries); ++s) {
      const auto values = given_or(scenarios[s].Q, view.Q.values);
      for (std::size_t j = 0; j < own; ++j) {
        append_column(Q_.linking, j, 0, values, weights[s], Q);
        append_column(Q_.recourse, j, static_cast<Index>(plan + s * own), values, weights[s], Q);
        Q.end_column();
      }
    }
    result.Q = Q.take();
  }

  each_part([&](const Part& part) {
    const std::size_t rows = part.rows.assembled(count);
    if (stopped || !fits(size_of(part.stages)) || !fits(rows)) return;
    ColumnBuilder matrix(static_cast<Index>(rows), result.g.size(), size_of(part.stages));
    const auto first_row = [&](std::size_t s) {
      return static_cast<Index>(part.rows.first.size() + s * part.rows.second.size());
    };
    const auto values = [&](std::size_t s) {
      return given_or(scenarios[s].*part.values, part.matrix.values);
    };
    for (std::size_t j = 0; j < plan && !stopped; ++j) {
      append_column(part.stages.first, j, 0, part.matrix.values, 1.0, matrix);
      const auto linked =
          static_cast<std::size_t>(part.stages.linking.pointers[j + 1] - part.stages.linking.pointers[j]);
      for (std::size_t s = 0; s < count && !stops_after(linked); ++s)
        append_column(part.stages.linking, j, first_row(s), values(s), 1.0, matrix);
      matrix.end_column();
    }
    for (std::size_t s = 0; s < count && !stops_after(own + entries(part.stages.recourse)); ++s)
      for (std::size_t j = 0; j < own; ++j) {
        append_column(part.stages.recourse, j, first_row(s), values(s), 1.0, matrix);
        matrix.end_column();
      }
    result.*part.into = matrix.take();
    std::vector<double>& offset = result.*part.offset_into = gather(part.offset, part.rows.first);
    offset.reserve(rows);
    for (std::size_t s = 0; s < count && !stops_after(part.rows.second.size()); ++s) {
      const auto given = given_or(scenarios[s].*part.offsets, part.offset);
      for (const Index row : part.rows.second) offset.push_back(at(given, row));
    }
  });
  if (stopped)
    return unexpected(failure(
        interrupt.stop_requested() ? ErrorCode::cancelled : ErrorCode::deadline_exceeded,
        "the problem of " + std::to_string(count) + " scenarios was being assembled when the solve ended"));
  if (too_many)
    return unexpected(failure(ErrorCode::resource_exhausted, "scenarios", std::to_string(count),
                              "their problem must have less than 2^31 entries in each matrix"));
  return result;
}

OwnedProblem Stages::recourse(const ScenarioNumbers& scenario, std::span<const double> x) const {
  const ProblemView& view = base_.view();
  OwnedProblem result;
  result.hessian_form = HessianForm::upper_triangle;
  const std::size_t own = variables.second.size();
  const auto block_matrix = [&](const Block& block, std::size_t rows, std::span<const double> values) {
    ColumnBuilder matrix(static_cast<Index>(rows), own, entries(block));
    for (std::size_t j = 0; j < own; ++j) {
      append_column(block, j, 0, values, 1.0, matrix);
      matrix.end_column();
    }
    return matrix.take();
  };
  const auto g = given_or(scenario.g, view.g);
  const auto Q = given_or(scenario.Q, view.Q.values);
  result.Q = block_matrix(Q_.recourse, own, Q);
  result.g = gather(g, variables.second);
  result.c0 = scenario.c0.value_or(view.c0);
  for (std::size_t i = 0; i < x.size(); ++i) result.c0 += at(g, variables.first[i]) * x[i];
  for (std::size_t j = 0; j < x.size(); ++j)
    for (Index k = Q_.first.pointers[j]; k < Q_.first.pointers[j + 1]; ++k) {
      const auto entry = static_cast<std::size_t>(k);
      const auto i = static_cast<std::size_t>(Q_.first.rows[entry]);
      result.c0 += (i == j ? 0.5 : 1.0) * at(Q, Q_.first.positions[entry]) * x[i] * x[j];
    }
  for (std::size_t j = 0; j < own; ++j)
    for (Index k = Q_.linking.pointers[j]; k < Q_.linking.pointers[j + 1]; ++k) {
      const auto entry = static_cast<std::size_t>(k);
      result.g[j] += at(Q, Q_.linking.positions[entry]) * x[static_cast<std::size_t>(Q_.linking.rows[entry])];
    }
  each_part([&](const Part& part) {
    const auto values = given_or(scenario.*part.values, part.matrix.values);
    result.*part.into = block_matrix(part.stages.recourse, part.rows.second.size(), values);
    std::vector<double>& offset = result.*part.offset_into =
                                      gather(given_or(scenario.*part.offsets, part.offset), part.rows.second);
    add_product(part.stages.linking, values, x, offset);
  });
  return result;
}

OwnedProblem Stages::alone(const ScenarioNumbers& scenario) const {
  const ProblemView& view = base_.view();
  const auto owned = [](std::span<const double> values) {
    return std::vector<double>(values.begin(), values.end());
  };
  OwnedProblem result;
  result.hessian_form = view.hessian_form;
  result.c0 = scenario.c0.value_or(view.c0);
#define MARBLE_VECTOR(letter, field) result.letter = owned(given_or(scenario.letter, view.letter));
#define MARBLE_MATRIX(letter, field, update, vector)                                         \
  result.letter = {view.letter.rows,                                                         \
                   view.letter.columns,                                                      \
                   {view.letter.column_pointers.begin(), view.letter.column_pointers.end()}, \
                   {view.letter.row_indices.begin(), view.letter.row_indices.end()},         \
                   owned(given_or(scenario.letter, view.letter.values))};
#include "marble/contract.def"
  return result;
}

}  // namespace marble
