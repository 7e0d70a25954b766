#include "support/small_problems.h"

#include <initializer_list>
#include <string>

namespace marble::testing {
namespace {

using Row = std::vector<double>;

// Dense rows, the last entry of each being the constant.
class Builder {
 public:
  Builder(std::string name, Row gradient) {
    p_.name = std::move(name);
    p_.g = std::move(gradient);
  }
  /// Adds ½ factor z_i z_j + ½ factor z_j z_i, or ½ factor z_i² for i = j.
  Builder& quadratic(Index i, Index j, double factor) {
    hessian_.add(i, j, factor);
    if (i != j) hessian_.add(j, i, factor);
    return *this;
  }
  Builder& constant(double c0) { return p_.c0 = c0, *this; }
  Builder& equal(const Row& row) { return add(row, equalities_, p_.b); }
  Builder& at_least(const Row& row) { return add(row, inequalities_, p_.d); }
  Builder& pair(const Row& left, const Row& right) { return add(left, left_, p_.l).add(right, right_, p_.r); }

  [[nodiscard]] SmallProblem optimum(double value) {
    const auto n = static_cast<Index>(p_.g.size());
    p_.Q = compress(n, n, hessian_, "Q").value();
    p_.A = compress(static_cast<Index>(p_.b.size()), n, equalities_, "A").value();
    p_.C = compress(static_cast<Index>(p_.d.size()), n, inequalities_, "C").value();
    p_.L = compress(static_cast<Index>(p_.l.size()), n, left_, "L").value();
    p_.R = compress(static_cast<Index>(p_.r.size()), n, right_, "R").value();
    return {p_, value};
  }

 private:
  Builder& add(const Row& row, Triplets& entries, std::vector<double>& offsets) {
    for (std::size_t j = 0; j + 1 < row.size(); ++j) {
      if (row[j] != 0.0) entries.add(static_cast<Index>(offsets.size()), static_cast<Index>(j), row[j]);
    }
    offsets.push_back(row.back());
    return *this;
  }

  OwnedProblem p_;
  Triplets hessian_, equalities_, inequalities_, left_, right_;
};

}  // namespace

SmallProblem public_example() {
  Builder b("public example", {0, 0, 0, 0});
  for (Index i = 0; i < 4; ++i) b.quadratic(i, i, 2.0);
  return b.equal({1, 0, 0, 0, -1})
      .at_least({0, 1, 0, 0, -1})
      .pair({0, 0, 1, 0, 1}, {0, 0, 0, 1, -1})
      .optimum(3.0);
}

std::vector<SmallProblem> small_problems() {
  std::vector<SmallProblem> all;
  all.push_back(public_example());

  // MacMPEC. (x − 1)² + y², 0 ≤ y ⊥ y − x ≥ 0.
  all.push_back(Builder("jr1", {-2, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(1)
                    .pair({0, 1, 0}, {-1, 1, 0})
                    .optimum(0.5));
  // (y − 1)² + x², 0 ≤ y ⊥ y − x ≥ 0.
  all.push_back(Builder("jr2", {0, -2})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(1)
                    .pair({0, 1, 0}, {-1, 1, 0})
                    .optimum(0.5));
  // x + y, 0 ≤ x ⊥ y ≥ 0.
  all.push_back(Builder("kth1", {1, 1}).pair({1, 0, 0}, {0, 1, 0}).optimum(0.0));
  // x + (y − 1)², the same pair.
  all.push_back(
      Builder("kth2", {1, -2}).quadratic(1, 1, 2).constant(1).pair({1, 0, 0}, {0, 1, 0}).optimum(0.0));
  // ½(x − 1)² + (y − 1)²
  all.push_back(Builder("kth3", {-1, -2})
                    .quadratic(0, 0, 1)
                    .quadratic(1, 1, 2)
                    .constant(1.5)
                    .pair({1, 0, 0}, {0, 1, 0})
                    .optimum(0.5));
  // ½((x − 1)² + (y − 1)²)
  all.push_back(Builder("scholtes3", {-1, -1})
                    .quadratic(0, 0, 1)
                    .quadratic(1, 1, 1)
                    .constant(1)
                    .pair({1, 0, 0}, {0, 1, 0})
                    .optimum(0.5));
  // x² + (u − 10)², 0 ≤ x ≤ 15; 0 ≤ 4(x + 2u − 30) + λ ⊥ u ≥ 0; 0 ≤ 20 − x − u ⊥ λ ≥ 0.
  all.push_back(Builder("gauvin", {0, -20, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(100)
                    .at_least({1, 0, 0, 0})
                    .at_least({-1, 0, 0, 15})
                    .pair({4, 8, 1, -120}, {0, 1, 0, 0})
                    .pair({-1, -1, 0, 20}, {0, 0, 1, 0})
                    .optimum(20.0));
  // (x − 5)² + (2y + 1)² over y solving min (y − 1)² − 1.5xy with three constraints, by its KKT conditions.
  all.push_back(Builder("bard1", {-10, 4, 0, 0, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 8)
                    .constant(26)
                    .equal({-1.5, 2, 1, -0.5, 1, -2})
                    .at_least({1, 0, 0, 0, 0, 0})
                    .at_least({0, 1, 0, 0, 0, 0})
                    .pair({3, -1, 0, 0, 0, -3}, {0, 0, 1, 0, 0, 0})
                    .pair({-1, 0.5, 0, 0, 0, 4}, {0, 0, 0, 1, 0, 0})
                    .pair({-1, -1, 0, 0, 0, 7}, {0, 0, 0, 0, 1, 0})
                    .optimum(17.0));

  // Without pairs.
  all.push_back(Builder("unconstrained", {-2, 4}).quadratic(0, 0, 2).quadratic(1, 1, 2).optimum(-5.0));
  all.push_back(
      Builder("equality only", {0, 0}).quadratic(0, 0, 2).quadratic(1, 1, 2).equal({1, 1, -2}).optimum(2.0));
  all.push_back(Builder("inequality only", {-4, -4})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .at_least({-1, -1, 2})
                    .optimum(-6.0));
  all.push_back(Builder("linear program", {-1, -2})
                    .at_least({1, 0, 0})
                    .at_least({0, 1, 0})
                    .at_least({-1, -1, 1})
                    .optimum(-2.0));
  // Degenerate ones.
  all.push_back(Builder("biactive at the origin", {1, 1})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .pair({1, 0, 0}, {0, 1, 0})
                    .optimum(0.0));
  all.push_back(Builder("duplicate equality", {0, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .equal({1, 1, -2})
                    .equal({2, 2, -4})
                    .optimum(2.0));
  all.push_back(Builder("duplicate inequality", {-4, -4})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .at_least({-1, -1, 2})
                    .at_least({-3, -3, 6})
                    .optimum(-6.0));
  all.push_back(
      Builder("zero row", {-2, 0}).quadratic(0, 0, 2).quadratic(1, 1, 2).at_least({0, 0, 1}).optimum(-1.0));
  all.push_back(Builder("both sides of a pair are forced", {-1, -1})
                    .quadratic(0, 0, 1)
                    .quadratic(1, 1, 1)
                    .equal({1, 0, 0})
                    .at_least({0, -1, 3})
                    .pair({1, 0, 0}, {0, 1, 0})
                    .optimum(-0.5));
  all.push_back(Builder("badly scaled", {-2e-3, 0})
                    .quadratic(0, 0, 2e-6)
                    .quadratic(1, 1, 2e6)
                    .constant(1)
                    .pair({0, 1e3, 0}, {-1e-3, 1e3, 0})
                    .optimum(0.5));
  all.push_back(Builder("two chained pairs", {-2, -4, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .quadratic(2, 2, 2)
                    .pair({1, 0, 0, 0}, {0, 1, 0, 0})
                    .pair({0, 1, 0, 0}, {0, 0, 1, 0})
                    .optimum(-4.0));
  return all;
}

}  // namespace marble::testing
