#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <stop_token>
#include <string>
#include <vector>

#include "families.h"
#include "hard_families.h"
#include "marble/warm_solver.h"
#include "support/branch.h"
#include "support/control_step.h"
#include "support/independent_check.h"

namespace marble::suite {
namespace {

struct Tally {
  int problems = 0, solved = 0, wrong = 0;
  std::map<std::string, int> unsolved;  // by status
  std::vector<double> factorizations, milliseconds;
  double lowest_sum = 0.0;
};

// True if an independent check or the construction of the problem contradicts the status.
bool is_wrong(const Record& r, const HardProblem& problem) {
  if (is_solved(r.status)) return problem.proof || r.violation > 1e-6;
  const bool claims_proof = r.status == Status::infeasible || r.status == Status::unbounded;
  return claims_proof && problem.proof != r.status;
}

}  // namespace

void hard(const Settings& settings) {
  std::vector<std::string> order;
  std::map<std::string, Tally> tallies;
  for (const HardProblem& problem : hard_problems(settings.seeds, settings.judging)) {
    Tally& tally = tallies[problem.family];
    if (tally.problems++ == 0) order.push_back(problem.family);
    const Record r = solve_and_judge(problem.family, problem.problem, {}, 0.0);
    const bool wrong = is_wrong(r, problem);
    const double optimum = problem.optimum.value_or(r.objective);
    const bool best = std::abs(r.objective - optimum) <= 1e-6 * std::max(1.0, std::abs(optimum));
    const bool solved = problem.proof ? r.status == problem.proof : is_solved(r.status) && !wrong && best;
    tally.solved += solved;
    tally.wrong += wrong;
    if (!solved) ++tally.unsolved[to_string(r.status)];
    if (solved && !problem.proof) tally.lowest_sum += r.objective;
    tally.factorizations.push_back(r.factorizations);
    tally.milliseconds.push_back(r.milliseconds);
  }
  std::printf("%-18s %8s %6s %6s %13s %6s %10s %10s %16s  %s\n", "family", "problems", "solved", "wrong",
              "factorizations", "worst", "ms", "worst", "mean objective", "else");
  for (const std::string& family : order) {
    const Tally& tally = tallies[family];
    std::string rest;
    for (const auto& [status, count] : tally.unsolved)
      rest += (rest.empty() ? "" : ", ") + std::to_string(count) + " " + status;
    std::printf("%-18s %8d %6d %6d %13.0f %6.0f %10.3f %10.3f %16.9g  %s\n", family.c_str(), tally.problems,
                tally.solved, tally.wrong, median(tally.factorizations),
                *std::ranges::max_element(tally.factorizations), median(tally.milliseconds),
                *std::ranges::max_element(tally.milliseconds), tally.lowest_sum / std::max(1, tally.solved),
                rest.c_str());
  }
  std::printf("\n");
}

}  // namespace marble::suite

// Checks feasible starts of control steps: no solution may be infeasible, above its start, or above the
// optimum of the start's branch.
namespace marble::suite {
namespace {

constexpr int kTicks = 5;

struct StartTally {
  const char* how;
  bool of_branch = true;  ///< its solution is not above the optimum of the start's branch
  int answers = 0, infeasible = 0, above_start = 0, above_branch = 0, solved = 0;
  std::vector<double> factorizations = {};

  void count(const OwnedProblem& p, double start, double branch, const Solution& s) {
    const auto above = [&](double than) { return s.objective > than + 1e-8 * std::max(1.0, std::abs(than)); };
    ++answers;
    infeasible += testing::judge(p.view(), s).infeasibility() > 1e-6;
    above_start += above(start);
    above_branch += of_branch && above(branch);
    solved += s.status == Status::solved;
    factorizations.push_back(s.factorizations);
  }
};

double objective_at(const OwnedProblem& p, const std::vector<double>& z) {
  return testing::judge_point(p.view(), z).objective;
}

// Returns the values of a matrix's rows at z.
std::vector<double> at(const SparseMatrix& matrix, std::vector<double> values, const std::vector<double>& z) {
  for (std::size_t j = 0; j < z.size(); ++j) {
    for (Index k = matrix.column_pointers[j]; k < matrix.column_pointers[j + 1]; ++k)
      values[static_cast<std::size_t>(matrix.row_indices[static_cast<std::size_t>(k)])] +=
          matrix.values[static_cast<std::size_t>(k)] * z[j];
  }
  return values;
}

// Returns the optimum of the QP with the smaller side of each pair held at zero.
double branch_optimum(const OwnedProblem& p, const std::vector<double>& z) {
  const std::vector<double> s = at(p.L, p.l, z), t = at(p.R, p.r, z);
  std::vector<bool> s_zero(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) s_zero[i] = s[i] <= t[i];
  const Solution solution = solve_in_process(testing::branch(p, s_zero).view()).value();
  return solution.status == Status::solved ? solution.objective : INFINITY;
}

// One controller: its steps solved separately, in a session, warm, and stopped.
void follow(std::uint64_t seed, std::array<StartTally, 5>& tallies) {
  testing::ControlSteps steps(seed);
  OwnedProblem p = steps.problem();
  WarmSolver session = WarmSolver::create(Problem::create(p.view()).value()).value();
  Solution last;
  for (int tick = 0; tick < kTicks; ++tick, steps.advance(), p = steps.problem()) {
    const double start = objective_at(p, p.initial_z), branch = branch_optimum(p, p.initial_z);
    const auto count = [&](StartTally& t, const Solution& s) { t.count(p, start, branch, s); };
    std::stop_source stopped;
    stopped.request_stop();
    const Solution alone = solve_in_process(p.view(), {}, {.initial_z = p.initial_z}).value();
    count(tallies[0], alone);
    count(tallies[1],
          session.solve({.c0 = p.c0, .g = p.g, .b = p.b, .r = p.r}, {.initial_z = p.initial_z}).value());
    Solution warm = tick == 0 ? alone : last;
    warm.z = p.initial_z;
    count(tallies[2], solve_in_process(p.view(), {}, {.warm_start = &warm}).value());
    Solver solver = Solver::create(Problem::create(p.view()).value(), {.max_iterations = 1}).value();
    count(tallies[3], solver.solve({.initial_z = p.initial_z}).value());
    count(tallies[4], solver.solve({.stop = stopped.get_token(), .initial_z = p.initial_z}).value());
    last = alone;
  }
}

}  // namespace

void starts(const Settings& settings) {
  std::array<StartTally, 5> tallies{StartTally{"by itself"}, StartTally{"in a session"},
                                    StartTally{"warm start's z", false}, StartTally{"one iteration"},
                                    StartTally{"stopped", false}};
  for (int i = 0; i < settings.seeds; ++i)
    follow(2 * static_cast<std::uint64_t>(i) + (settings.judging ? 2 : 1), tallies);
  std::printf("%-15s %8s %8s %11s %12s %13s %14s %6s\n", "feasible start", "answers", "solved", "infeasible",
              "above start", "above branch", "factorizations", "worst");
  for (const StartTally& t : tallies) {
    std::printf("%-15s %8d %8d %11d %12d %13d %14.0f %6.0f\n", t.how, t.answers, t.solved, t.infeasible,
                t.above_start, t.above_branch, median(t.factorizations),
                *std::ranges::max_element(t.factorizations));
  }
}

}  // namespace marble::suite
