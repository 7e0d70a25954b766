#include "model.h"

#include <stdexcept>

namespace marble::examples {
namespace {

SparseMatrix compressed(Index rows, Index columns, const Triplets& entries, const char* name) {
  auto matrix = compress(rows, columns, entries, name);
  if (!matrix) throw std::logic_error(matrix.error().message());  // a generator's error, not a user's
  return std::move(*matrix);
}

}  // namespace

Model::Model(std::string name, Index variables)
    : name_(std::move(name)), variables_(variables), gradient_(static_cast<std::size_t>(variables), 0.0) {}

void Model::Rows::add(const Terms& terms, double constant) {
  const auto row = static_cast<Index>(constants.size());
  for (const Term& term : terms) {
    if (term.factor != 0.0) entries.add(row, term.variable, term.factor);
  }
  constants.push_back(constant);
}

void Model::within(const Terms& terms, double bound) {
  Terms negated = terms;
  for (Term& term : negated) term.factor = -term.factor;
  at_least_zero(terms, bound);
  at_least_zero(negated, bound);
}

void Model::complementary(const Terms& s, double s_constant, const Terms& t, double t_constant) {
  left_.add(s, s_constant);
  right_.add(t, t_constant);
}

void Model::add_square(double weight, const Terms& terms, double constant) {
  for (const Term& a : terms) {
    for (const Term& b : terms) hessian_.add(a.variable, b.variable, weight * a.factor * b.factor);
    gradient_[static_cast<std::size_t>(a.variable)] += weight * a.factor * constant;
  }
  constant_ += 0.5 * weight * constant * constant;
}

SparseMatrix Model::matrix(const Rows& rows, const char* name) const {
  return compressed(static_cast<Index>(rows.constants.size()), variables_, rows.entries, name);
}

OwnedProblem Model::problem() const {
  OwnedProblem p;
  p.name = name_;
  p.Q = compressed(variables_, variables_, hessian_, "Q");
  p.g = gradient_;
  p.c0 = constant_;
  p.A = matrix(equalities_, "A");
  p.b = equalities_.constants;
  p.C = matrix(inequalities_, "C");
  p.d = inequalities_.constants;
  p.L = matrix(left_, "L");
  p.l = left_.constants;
  p.R = matrix(right_, "R");
  p.r = right_.constants;
  return p;
}

}  // namespace marble::examples
