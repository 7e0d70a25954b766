// y <= 50 and y >= 51 were `locally_infeasible` after 687 factorizations when the solve began at a corner of
// the other rows; from zero they were `infeasible`. Documented: what is infeasible whatever the pairs is
// proved.
//
// The elastic problem of the feasibility phase's tree failed from there at its root, and a root that failed
// is no proof. Now a small problem has the tree of option global_search look too, whose bounds need no good
// start.
#include <gtest/gtest.h>

#include "marble/solver.h"

namespace marble {
namespace {

// min Σ (yᵢ − 60)² + (wᵢ + i − 4)² + yᵢ wᵢ₊₁  s.t.  vᵢ = wᵢ,  0 ≤ vᵢ ⊥ yᵢ ≥ 0,  yᵢ ≤ 50,  y₀ + y₁ ≤ 70,  y₀
// ≥ 51.
OwnedProblem contradiction() {
  OwnedProblem p;
  Triplets Q, A, C, L, R;
  for (Index i = 0; i < 3; ++i) {
    const Index y = i, w = 3 + i, v = 6 + i, next = 3 + (i + 1) % 3;
    Q.add(y, y, 2.0), Q.add(w, w, 2.0);
    Q.add(y, next, 1.0), Q.add(next, y, 1.0);
    A.add(i, w, -1.0), A.add(i, v, 1.0);
    C.add(2 + i, y, -1.0);
    L.add(i, v, 1.0), R.add(i, y, 1.0);
  }
  C.add(0, 0, -1.0), C.add(0, 1, -1.0), C.add(1, 0, 1.0);
  p.Q = compress(9, 9, Q, "Q").value();
  p.A = compress(3, 9, A, "A").value();
  p.C = compress(5, 9, C, "C").value();
  p.L = compress(3, 9, L, "L").value();
  p.R = compress(3, 9, R, "R").value();
  p.g = {-120.0, -120.0, -120.0, -8.0, -6.0, -4.0, 0.0, 0.0, 0.0};
  p.b.assign(3, 0.0), p.l.assign(3, 0.0), p.r.assign(3, 0.0);
  p.d = {70.0, -51.0, 50.0, 50.0, 50.0};
  return p;
}

TEST(UnprovedContradiction, IsInfeasibleWhereverTheSolveBegins) {
  const OwnedProblem p = contradiction();
  const std::vector<double> corner = {34.99999999999999,
                                      35.0,
                                      49.99999999999999,
                                      -4.666674063759982e-18,
                                      -3.2499990100444162e-18,
                                      -3.41667003522813e-18,
                                      0.0,
                                      0.0,
                                      0.0};
  for (const std::vector<double>& z : {std::vector<double>(9, 0.0), corner, std::vector<double>(9, 50.0)}) {
    const Solution s = solve_in_process(p.view(), {}, {.initial_z = z}).value();
    EXPECT_EQ(s.status, Status::infeasible) << s.detail;
  }
}

}  // namespace
}  // namespace marble
