// The dense random problems of MacMPEC. Its author drew them in MATLAB 5 and published the numbers; they are
// generated here again, by the same generator.
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include "macmpec/problems.h"

namespace marble::examples::macmpec_sources {
namespace {

// MATLAB 5's rand from its first state: subtract with borrow of 53-bit fractions (Marsaglia and Zaman, 1991),
// the mantissa combined with a 32-bit shift register (C. Moler, Random Thoughts, MATLAB News, 1995).
class Matlab5 {
 public:
  Matlab5() {
    for (std::uint64_t& fraction : fractions_) {
      for (int bit = 0; bit < 53; ++bit) {
        shift();
        fraction = 2 * fraction + (register_ >> 19 & 1);
      }
    }
    register_ = kFirst;
  }

  double uniform() {
    const std::uint64_t subtrahend = fractions_[(next_ + 5) % 32] + borrow_;
    const std::uint64_t minuend = fractions_[(next_ + 20) % 32];
    borrow_ = minuend < subtrahend ? 1 : 0;
    const std::uint64_t fraction = minuend - subtrahend + (borrow_ << 53);
    fractions_[next_] = fraction;
    next_ = (next_ + 1) % 32;
    const std::uint64_t low = register_;
    shift();
    const std::uint64_t high = register_ & 0xFFFFF;
    const double value = std::ldexp(static_cast<double>(fraction), -53);
    return std::bit_cast<double>(std::bit_cast<std::uint64_t>(value) ^ (high << 32 | low));
  }

  Eigen::MatrixXd matrix(Index rows, Index columns) {
    Eigen::MatrixXd all(rows, columns);
    for (double& entry : all.reshaped()) entry = uniform();
    return all;
  }

 private:
  static constexpr std::uint32_t kFirst = 1U << 31;
  void shift() {
    register_ ^= register_ << 13;
    register_ ^= register_ >> 17;
    register_ ^= register_ << 5;
  }
  std::array<std::uint64_t, 32> fractions_{};
  std::uint64_t borrow_ = 0;
  std::size_t next_ = 0;
  std::uint32_t register_ = kFirst;
};

struct Sizes {
  Index constraints, pairs, x;
};
// In the order in which they were drawn. The collection's first problem is the third of its sizes.
constexpr Sizes kDrawn[] = {{30, 30, 50}, {30, 30, 50},  {30, 30, 50},
                            {50, 60, 50}, {100, 70, 70}, {150, 100, 100}};

}  // namespace

// min ½|x|² + Σy s.t. A x ≤ b, 0 ≤ y ⊥ N x + M y + q ≥ 0, with A in [−4, 4], N in [0, 8], M in [0, 1] but
// for a dominant diagonal, q in [0, 4], and b ≥ 0 such that x = e is feasible. The solution is 0.
OwnedProblem flp4(const char* name, int number) {
  Matlab5 random;
  Eigen::MatrixXd A, N, M, b, q;
  for (int i = 0; i < number + 2; ++i) {
    const auto& [constraints, pairs, x] = kDrawn[i];
    A = 8.0 * random.matrix(constraints, x).array() - 4.0;
    N = 8.0 * random.matrix(pairs, x);
    M = random.matrix(pairs, pairs);
    b = (8.0 * random.matrix(constraints, 1)).cwiseMax(A.rowwise().sum());
    q = 4.0 * random.matrix(pairs, 1);
  }
  M.diagonal().setZero();
  M.diagonal() = M.rowwise().sum().cwiseMax(M.colwise().sum().transpose()).array() + 0.01;

  const auto [constraints, pairs, x] = kDrawn[number + 1];
  Model model(name, x + pairs);
  for (Index j = 0; j < x; ++j) model.add_square(1.0, {{j, 1.0}});
  for (Index i = 0; i < constraints; ++i) {
    Terms row;
    for (Index j = 0; j < x; ++j) row.push_back({j, -A(i, j)});
    model.at_least_zero(row, b(i));
  }
  for (Index i = 0; i < pairs; ++i) {
    model.add_linear(1.0, x + i);
    Terms row;
    for (Index j = 0; j < x; ++j) row.push_back({j, N(i, j)});
    for (Index j = 0; j < pairs; ++j) row.push_back({x + j, M(i, j)});
    model.complementary({{x + i, 1.0}}, 0.0, row, q(i));
  }
  OwnedProblem problem = model.problem();
  problem.initial_z.assign(static_cast<std::size_t>(x), 1.0);
  problem.initial_z.resize(static_cast<std::size_t>(x + pairs));
  return problem;
}

}  // namespace marble::examples::macmpec_sources
