#include "judgement.h"

#include <cmath>

#include "marble/convert.h"
#include "marble/examples.h"
#include "problems.h"
#include "support/independent_check.h"

namespace marble::testing {
namespace {

constexpr double kTolerance =
    1e-6;  // the options' default, of a solved point; a reduced one has 100 times it

v1::SolveRequest request_of(const OwnedProblem& problem, const char* name) {
  v1::SolveRequest request;
  to_message(problem.view(), request.mutable_problem());
  request.mutable_problem()->set_name(name);
  return request;
}

}  // namespace

const std::vector<v1::SolveRequest>& small_problems() {
  static const std::vector<v1::SolveRequest> problems = [] {
    std::vector<v1::SolveRequest> result = {example_request()};
    for (const int steps : {2, 4, 8}) {
      examples::HopperParameters parameters;
      parameters.steps = steps;
      result.push_back(request_of(examples::hopper(parameters), "hopper"));
    }
    for (const std::uint64_t seed : {1U, 2U})
      result.push_back(request_of(examples::qpec({6, 12, 2, 1}, seed), "qpec"));
    return result;
  }();
  return problems;
}

Judgement judge(const v1::Problem& problem, const v1::Solution& solution) {
  const bool solved = solution.status() == v1::STATUS_SOLVED;
  const bool reduced = solution.status() == v1::STATUS_ALMOST_SOLVED;
  Judgement judgement;
  judgement.solved = solved || reduced;
  const std::string what = problem.name() + ", " + v1::Status_Name(solution.status()) + ": ";
  if (solution.status() == v1::STATUS_UNSPECIFIED) judgement.fault = what + "no status";
  if (solution.z_size() != problem.gradient_size())
    judgement.fault = what + std::to_string(solution.z_size()) + " entries";
  if (!judgement.solved || !judgement.fault.empty()) return judgement;
  const Verdict verdict = judge(view_of(problem), solution_of(solution));
  if (!(verdict.infeasibility() <= (solved ? 1.01 : 101.0) * kTolerance))
    judgement.fault = what + "infeasible by " + std::to_string(verdict.infeasibility());
  if (!(std::abs(verdict.objective - solution.objective()) <= 1e-8 * (1.0 + std::abs(verdict.objective))))
    judgement.fault = what + "objective " + std::to_string(solution.objective()) + " instead of " +
                      std::to_string(verdict.objective);
  return judgement;
}

}  // namespace marble::testing
