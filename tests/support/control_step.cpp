#include "support/control_step.h"

#include <stdexcept>
#include <string>
#include <vector>

#include "model.h"
#include "support/dense_algebra.h"

namespace marble::testing {
namespace {

using examples::Model;
using examples::Terms;
using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr double kMostInput = 2.0;

Terms row_of(const Matrix& matrix, Index row, Index first) {
  Terms terms;
  for (Index j = 0; j < matrix.cols(); ++j) terms.push_back({first + j, matrix(row, j)});
  return terms;
}

}  // namespace

Matrix ControlSteps::random(Index rows, Index columns, double size) {
  return Matrix::NullaryExpr(rows, columns, [&] { return size * uniform(); });
}

ControlSteps::ControlSteps(std::uint64_t seed)
    : engine_(seed),
      stages_(static_cast<Index>(5 + engine_() % 8)),
      states_(static_cast<Index>(2 + engine_() % 5)),
      inputs_(static_cast<Index>(1 + engine_() % 2)),
      pairs_(static_cast<Index>(2 + engine_() % 3)) {
  A_ = Matrix::Identity(states_, states_) + random(states_, states_, 0.2);
  B_ = random(states_, inputs_, 0.5);
  D_ = random(states_, pairs_, 0.3);
  E_ = random(pairs_, states_, 1.0);
  const Matrix root = random(pairs_, pairs_, 1.0);
  F_ = root * root.transpose() + 0.3 * Matrix::Identity(pairs_, pairs_);
  H_ = random(pairs_, inputs_, 0.5);
  c_ = random(pairs_, 1, 0.5);
  state_ = random(states_, 1, 1.0);
  target_ = random(states_, 1, 1.0);
  plan_ = random(inputs_, stages_, 0.9 * kMostInput);
}

// Solves the LCP of F by enumeration of its branches: it has exactly one solution, and few pairs.
Vector ControlSteps::forces(const Vector& x, const Vector& u) const {
  const Vector q = E_ * x + H_ * u + c_;
  Vector best;
  double least = INFINITY;
  for (unsigned branch = 0; branch < 1U << pairs_; ++branch) {
    Matrix m = Matrix::Identity(pairs_, pairs_);
    Vector right = Vector::Zero(pairs_);
    for (Index i = 0; i < pairs_; ++i) {
      if ((branch >> i & 1U) == 0) continue;
      m.row(i) = F_.row(i);
      right[i] = -q[i];
    }
    const Vector lambda = dense_solve(m, right);
    const double wrong = std::max(-lambda.minCoeff(), -(F_ * lambda + q).minCoeff());
    if (wrong < least) least = wrong, best = lambda;
  }
  if (least > 1e-9 * (1.0 + q.norm()))
    throw std::logic_error("an LCP with a positive definite matrix has a solution");
  return best.cwiseMax(0.0);
}

// A stage's variables: λ, u, and the resulting state.
OwnedProblem ControlSteps::problem() const {
  const Index stage = pairs_ + inputs_ + states_;
  Model model("control step", stages_ * stage);
  std::vector<double> start;
  Vector x = state_;
  for (Index k = 0; k < stages_; ++k) {
    const Index lambda = k * stage, u = lambda + pairs_, next = u + inputs_, last = next - stage;
    const Vector input = plan_.col(k), force = forces(x, input);
    const bool first = k == 0;
    for (Index i = 0; i < states_; ++i) {
      Terms row = row_of(B_, i, u) + row_of(D_, i, lambda);
      if (!first) row = std::move(row) + row_of(A_, i, last);
      row.push_back({next + i, -1.0});
      model.equal_zero(row, first ? A_.row(i).dot(state_) : 0.0);
      model.add_square(1.0, {{next + i, 1.0}}, -target_[i]);
    }
    for (Index i = 0; i < inputs_; ++i) {
      model.within({{u + i, 1.0}}, kMostInput);
      model.add_square(0.1, {{u + i, 1.0}});
    }
    for (Index i = 0; i < pairs_; ++i) {
      Terms gap = row_of(F_, i, lambda) + row_of(H_, i, u);
      if (!first) gap = std::move(gap) + row_of(E_, i, last);
      model.complementary({{lambda + i, 1.0}}, 0.0, gap, c_[i] + (first ? E_.row(i).dot(state_) : 0.0));
    }
    x = (A_ * x + B_ * input + D_ * force).eval();
    for (const Vector& part : {force, input, x}) start.insert(start.end(), part.begin(), part.end());
  }
  OwnedProblem problem = model.problem();
  problem.initial_z = std::move(start);
  return problem;
}

void ControlSteps::advance() {
  const Vector input = plan_.col(0);
  state_ = (A_ * state_ + B_ * input + D_ * forces(state_, input) + random(states_, 1, 0.02)).eval();
  target_ += random(states_, 1, 0.2);
  for (Index k = 0; k + 1 < stages_; ++k) plan_.col(k) = plan_.col(k + 1).eval();
  plan_.col(stages_ - 1) = random(inputs_, 1, 0.9 * kMostInput);
}

}  // namespace marble::testing
