// A block on a table, a spring that pulls it, and a wall at 0.5 m: how far to pull, so that it presses on the
// wall with about 0.3 N while the pull stays near 0.4 m?
//
//   z = (pull p, position x, contact force f)
//   min ½ (p − 0.4)² + ½ (f − 0.3)²   s.t.  p − x − f = 0   (spring of 1 N/m and contact in balance)
//                                           0 ≤ f  ⊥  0.5 − x ≥ 0   (no force without contact)
//
// Solves on the server that MARBLE_SERVER names, or in this process if it names none or is "local".
#include <marble/client.h>

#include <cstdio>

int main() {
  marble::OwnedProblem problem;
  marble::Triplets Q, A, L, R;
  Q.add(0, 0, 1.0);
  Q.add(2, 2, 1.0);
  problem.Q = marble::compress(3, 3, Q, "Q").value();
  problem.g = {-0.4, 0.0, -0.3};
  problem.c0 = 0.5 * (0.4 * 0.4 + 0.3 * 0.3);
  A.add(0, 0, 1.0);
  A.add(0, 1, -1.0);
  A.add(0, 2, -1.0);
  problem.A = marble::compress(1, 3, A, "A").value();
  problem.b = {0.0};
  L.add(0, 2, 1.0);
  problem.L = marble::compress(1, 3, L, "L").value();
  problem.l = {0.0};
  R.add(0, 1, -1.0);
  problem.R = marble::compress(1, 3, R, "R").value();
  problem.r = {0.5};

  const auto answer = marble::solve(problem.view());
  if (!answer) {
    std::fprintf(stderr, "%s\n", answer.error().message().c_str());
    return 1;
  }
  std::printf("%s: pull %.3f m, the block at %.3f m presses with %.3f N; objective %.4f\n",
              marble::to_string(answer->status), answer->z[0], answer->z[1], answer->z[2], answer->objective);
  return marble::is_solved(answer->status) ? 0 : 1;
}
