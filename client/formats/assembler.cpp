#include "assembler.h"

#include <cmath>

namespace marble::formats {
namespace {

Expected<SparseMatrix> matrix(Index variables, const Triplets& entries, std::size_t rows, const char* name) {
  return compress(static_cast<Index>(rows), variables, entries, name);
}

}  // namespace

AffineRow AffineRow::negated() const {
  AffineRow result = *this;
  for (auto& [variable, coefficient] : result.terms) coefficient = -coefficient;
  result.constant = -result.constant;
  return result;
}

void Assembler::Part::add(const AffineRow& row) {
  const auto at = static_cast<Index>(offsets.size());
  for (const auto& [variable, coefficient] : row.terms) entries.add(at, variable, coefficient);
  offsets.push_back(row.constant);
}

Index Assembler::add_variable() {
  g_.push_back(0.0);
  return variables() - 1;
}

Expected<void> Assembler::add_range(const AffineRow& row, double low, double high, const char* field,
                                    std::int64_t index) {
  if (std::isnan(low) || std::isnan(high) || low > high) {
    return unexpected(invalid(field, index, "[" + std::to_string(low) + ", " + std::to_string(high) + "]",
                              "must be bounds with the lower one first"));
  }
  if (low == high) {
    AffineRow equality = row;
    equality.constant -= low;
    equalities_.add(equality);
    return {};
  }
  if (low > -infinite_limit) {
    AffineRow above = row;
    above.constant -= low;
    inequalities_.add(above);
  }
  if (high < infinite_limit) {
    AffineRow below = row.negated();
    below.constant += high;
    inequalities_.add(below);
  }
  return {};
}

void Assembler::add_pair(const AffineRow& left, const AffineRow& right) {
  left_.add(left);
  right_.add(right);
}

void Assembler::add_mixed(const AffineRow& row, Index variable, double low, double high) {
  // row = p − q with 0 ≤ p ⊥ variable − low ≥ 0 and 0 ≤ q ⊥ high − variable ≥ 0.
  const Index p = add_variable(), q = add_variable();
  AffineRow split = row;
  split.terms.insert(split.terms.end(), {{p, -1.0}, {q, 1.0}});
  equalities_.add(split);
  add_pair(AffineRow::variable(p), AffineRow::variable(variable, -low));
  add_pair(AffineRow::variable(q), AffineRow::variable(variable, -high).negated());
}

Expected<OwnedProblem> Assembler::finish(const std::string& name) const {
  OwnedProblem problem;
  problem.name = name;
  const std::size_t n = g_.size();
  const struct {
    SparseMatrix* out;
    const Triplets* entries;
    std::size_t rows;
    const char* field;
  } parts[] = {{&problem.Q, &Q_, n, "Q"},
               {&problem.A, &equalities_.entries, equalities_.offsets.size(), "A"},
               {&problem.C, &inequalities_.entries, inequalities_.offsets.size(), "C"},
               {&problem.L, &left_.entries, left_.offsets.size(), "L"},
               {&problem.R, &right_.entries, right_.offsets.size(), "R"}};
  for (const auto& part : parts) {
    MARBLE_ASSIGN_OR_RETURN(*part.out, matrix(variables(), *part.entries, part.rows, part.field));
  }
  problem.g = g_;
  problem.c0 = c0_;
  problem.b = equalities_.offsets;
  problem.d = inequalities_.offsets;
  problem.l = left_.offsets;
  problem.r = right_.offsets;
  MARBLE_RETURN_IF_ERROR(Problem::create(problem.view()));
  return problem;
}

}  // namespace marble::formats
