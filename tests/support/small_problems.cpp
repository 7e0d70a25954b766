#include "support/small_problems.h"

#include <cmath>

#include "marble/macmpec.h"
#include "support/problem_builder.h"

namespace marble::testing {
namespace {

using Builder = ProblemBuilder;

}  // namespace

SmallProblem of_macmpec(std::string_view name) {
  const examples::MacmpecProblem& found = *examples::find_macmpec(name);
  SmallProblem small{found.problem(), found.optimum};
  small.problem.initial_z.clear();
  return small;
}

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

  for (const char* name : {"jr1", "jr2", "kth2", "kth3", "scholtes3", "gauvin", "bard1", "ex9_2_2", "ex9_2_5",
                           "ex9_2_6", "flp2", "sl1"})
    all.push_back(of_macmpec(name));
  // kth1 of MacMPEC: x + y, 0 ≤ x ⊥ y ≥ 0.
  all.push_back(Builder("kth1", {1, 1}).pair({1, 0, 0}, {0, 1, 0}).optimum(0.0));

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
  // Degenerate problems.
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
  all.push_back(Builder("duplicate pair", {-1, -2})
                    .quadratic(0, 0, 1)
                    .quadratic(1, 1, 2)
                    .constant(1.5)
                    .pair({1, 0, 0}, {0, 1, 0})
                    .pair({0, 3, 0}, {2, 0, 0})
                    .optimum(0.5));
  all.push_back(Builder("a pair's side without variables", {-2, -2})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(2)
                    .pair({0, 0, 1}, {1, 0, 0})
                    .optimum(1.0));
  all.push_back(Builder("two chained pairs", {-2, -4, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .quadratic(2, 2, 2)
                    .pair({1, 0, 0, 0}, {0, 1, 0, 0})
                    .pair({0, 1, 0, 0}, {0, 0, 1, 0})
                    .optimum(-4.0));
  return all;
}

OwnedProblem obstacle_problem(Index n) {
  OwnedProblem p;
  Triplets Q, C;
  const double inverse = n + 1.0;
  for (Index j = 0; j < n; ++j) {
    if (j > 0) Q.add(j - 1, j, -inverse), Q.add(j, j - 1, -inverse);
    Q.add(j, j, 2.0 * inverse);
    C.add(j, j, 1.0);
    const double x = (j + 1.0) / inverse;
    p.d.push_back(0.2 * (x - 0.4) * (x - 0.4) + 0.02 * std::sin(20.0 * x) + 0.03);  // u + d ≥ 0
    p.g.push_back(1.0 / inverse);
  }
  p.Q = compress(n, n, Q, "Q").value();
  p.C = compress(n, n, C, "C").value();
  return p;
}

}  // namespace marble::testing
