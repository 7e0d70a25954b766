// min z₁² + z₂² − 2z₁ + 1  s.t.  0 ≤ z₂ ⊥ z₂ − z₁ ≥ 0, solved in process; then the client's side of an empty
// port.
#include <marble/client.h>
#include <marble/solver.h>

#include <cmath>
#include <cstdio>

int main() {
  marble::OwnedProblem problem;
  problem.g = {-2.0, 0.0};
  problem.c0 = 1.0;
  problem.Q = {2, 2, {0, 1, 2}, {0, 1}, {2.0, 2.0}};
  problem.L = {1, 2, {0, 0, 1}, {0}, {1.0}};
  problem.l = {0.0};
  problem.R = {1, 2, {0, 1, 2}, {0, 0}, {-1.0, 1.0}};
  problem.r = {0.0};
  const auto solution = marble::solve_in_process(problem.view());
  if (!solution) return std::puts(solution.error().message().c_str()), 1;
  std::printf("%s, objective %.6f\n", marble::to_string(solution->status), solution->objective);
  const auto healthy = marble::Client::connect("127.0.0.1:1")->healthy();
  const bool refused = !healthy && healthy.error().code == marble::ErrorCode::unavailable;
  return std::abs(solution->objective - 0.5) < 1e-6 && refused ? 0 : 1;
}
