// Does one operation once, so that loadtest/perf/derivatives can count its instructions: a step's
// back-substitution with its refinement, or the requested number of derivatives of one kind at once.
//   derivative_costs FAMILY SIZE step|directions|losses COUNT
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "branch/branch_derivatives.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "micro/problems.h"

namespace marble {
namespace {

OwnedProblem problem_of(const std::string& family, int size) {
  if (family == "hopper") return micro::hopper(size);
  if (family == "rocket") return micro::rocket(size);
  if (family == "gates") return micro::gates(size);
  return micro::qpec(size);
}

std::vector<double> waves(std::size_t size) {
  std::vector<double> values(size);
  for (std::size_t i = 0; i < size; ++i) values[i] = std::sin(1.0 + 0.7 * static_cast<double>(i));
  return values;
}

/// The measured function; the counter finds it by name.
[[gnu::noinline]] void count_this(const std::function<bool()>& work) {
  if (!work()) std::abort();
}

int ask(const OwnedProblem& p, const std::string& what, Index count) {
  const Problem problem = Problem::create(p.view()).value();
  const Options options;
  const Solution answer = solve_once(problem, options).value();
  ScaledProblem scaled = scale(problem, options.scaling_passes);
  const auto kkt = make_kkt(scaled);
  BranchPoint point(scaled, *kkt);
  BranchDerivatives derivatives(scaled, PartSizes::of(problem), point);
  Iterate solution(scaled);
  take(scaled, answer, solution);
  const SolveControls controls;
  Run run(options, controls);
  if (!is_solved(answer.status) || !derivatives.begin(run, solution, false)) return 1;
  if (what == "step") {
    Vector x = Vector::Ones(scaled.variables()), y = Vector::Ones(scaled.equalities());
    count_this([&] { return kkt->solve(x, y); });
    std::printf("%s, n = %d\n", std::string(kkt->name()).c_str(), scaled.variables());
    return 0;
  }
  const auto times = static_cast<std::size_t>(count);
  const std::vector<double> g = waves(times * p.g.size()), b = waves(times * p.b.size());
  SensitivityRequest request;
  if (what == "directions") request.directions = {count, {.g = g, .b = b}};
  if (what == "losses") request.losses = {count, {.z = g}};
  const auto work = [&] { return derivatives.answer(run, request).has_value(); };
  if (!work()) return 1;  // allocates its memory
  const std::int32_t before = point.back_substitutions();
  count_this(work);
  std::printf("%.1f\n", static_cast<double>(point.back_substitutions() - before) / count);
  return 0;
}

}  // namespace
}  // namespace marble

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  return marble::ask(marble::problem_of(argv[1], std::atoi(argv[2])), argv[3], std::atoi(argv[4]));
}
