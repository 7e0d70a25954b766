// Sessions: what a step from the last solution loses against a cold solve, and its work.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <string>
#include <vector>

#include "families.h"
#include "lcs_systems.h"
#include "marble/examples.h"
#include "marble/warm_solver.h"
#include "noise.h"
#include "record.h"
#include "support/random_problem.h"

namespace marble::suite {
namespace {

constexpr double kWorse = 1e-6;  // relative: a step that loses more counts as worse
constexpr int kUpdates = 30;     // of g, and as many of constants

struct SessionTally {
  int steps = 0, unsolved = 0, worse = 0;
  double objectives = 0.0;
  std::vector<double> losses, factorizations, milliseconds, cold_factorizations;

  void add(const Solution& s) {
    ++steps;
    unsolved += !is_solved(s.status);
    objectives += s.objective;
    factorizations.push_back(s.factorizations);
    milliseconds.push_back(1e3 * s.times.solve_s);
  }
  void add(const Solution& s, const Solution& cold) {
    add(s);
    if (!is_solved(cold.status)) return;
    const double loss = (s.objective - cold.objective) / std::max(1.0, std::abs(cold.objective));
    worse += !is_solved(s.status) || loss > kWorse;
    losses.push_back(loss);
    cold_factorizations.push_back(cold.factorizations);
  }
};

double sum(const std::vector<double>& values) { return std::accumulate(values.begin(), values.end(), 0.0); }

double share(std::vector<double> values, double of) {
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(of * static_cast<double>(values.size() - 1))];
}

void print(const std::string& name, const SessionTally& t) {
  std::printf("%-22s %6d %8d %6d %9.1e %11.4f %11.0f %6.0f %6.0f %7.3f %7.2f", name.c_str(), t.steps,
              t.unsolved, t.worse, t.losses.empty() ? 0.0 : *std::ranges::max_element(t.losses),
              t.objectives / t.steps, sum(t.factorizations), median(t.factorizations),
              *std::ranges::max_element(t.factorizations), median(t.milliseconds),
              share(t.milliseconds, 0.99));
  if (!t.cold_factorizations.empty()) std::printf(" %11.0f", sum(t.cold_factorizations));
  std::printf("\n");
}

std::vector<double> images_of(const SparseMatrix& matrix, const std::vector<double>& z) {
  std::vector<double> values(static_cast<std::size_t>(matrix.rows), 0.0);
  for (Index j = 0; j < matrix.columns; ++j) {
    for (Index k = matrix.column_pointers[j]; k < matrix.column_pointers[j + 1]; ++k)
      values[matrix.row_indices[k]] += matrix.values[k] * z[j];
  }
  return values;
}

// A random problem whose vectors change by random walks. The constants follow a point that stays feasible.
class Walk {
 public:
  Walk(const testing::RandomSizes& sizes, std::uint64_t seed)
      : problem(testing::random_problem(sizes, seed)), noise_(seed) {
    point_ = solve_in_process(problem.view()).value().z;
    for (std::size_t i = 0; i < problem.d.size(); ++i)
      slack_.push_back(std::max(0.0, images_of(problem.C, point_)[i] + problem.d[i]));
    for (std::size_t i = 0; i < problem.l.size(); ++i)
      side_.push_back(images_of(problem.L, point_)[i] + problem.l[i] - images_of(problem.R, point_)[i] -
                      problem.r[i]);
  }
  void change_cost() {
    for (double& entry : problem.g) entry += 0.3 * noise_.uniform();
  }
  void change_constants() {
    for (double& entry : point_) entry += 0.1 * noise_.uniform();
    for (double& slack : slack_) slack = std::max(0.0, slack + 0.2 * noise_.uniform());
    for (double& side : side_) side += 0.2 * noise_.uniform();
    const auto place = [this](const SparseMatrix& matrix, std::vector<double>& constants, auto&& value) {
      const std::vector<double> images = images_of(matrix, point_);
      for (std::size_t i = 0; i < constants.size(); ++i) constants[i] = value(i) - images[i];
    };
    place(problem.A, problem.b, [](std::size_t) { return 0.0; });
    place(problem.C, problem.d, [this](std::size_t i) { return slack_[i]; });
    place(problem.L, problem.l, [this](std::size_t i) { return std::max(0.0, side_[i]); });
    place(problem.R, problem.r, [this](std::size_t i) { return std::max(0.0, -side_[i]); });
  }

  OwnedProblem problem;

 private:
  Noise noise_;
  std::vector<double> point_, slack_, side_;
};

void random_sessions(const testing::RandomSizes& sizes, int seeds, bool judging) {
  SessionTally tally;
  for (int number = 0; number < seeds; ++number) {
    Walk walk(sizes, static_cast<std::uint64_t>(2 * number + (judging ? 2 : 1)));
    OwnedProblem& p = walk.problem;
    WarmSolver session = WarmSolver::create(Problem::create(p.view()).value()).value();
    static_cast<void>(session.solve().value());
    for (int update = 0; update < 2 * kUpdates; ++update) {
      update % 2 == 0 ? walk.change_cost() : walk.change_constants();
      const Solution s = session.solve({.g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r}).value();
      tally.add(s, solve_in_process(p.view()).value());
    }
  }
  print("random " + std::to_string(sizes.pairs) + " of " + std::to_string(sizes.variables), tally);
}

void hoppers(int steps, int control_steps, int seeds, bool judging) {
  SessionTally tally;
  for (int number = 0; number < seeds; ++number) {
    examples::HopperParameters parameters{.steps = steps};
    parameters = examples::vary(parameters, static_cast<std::uint64_t>(2 * number + (judging ? 2 : 1)));
    OwnedProblem p = examples::hopper(parameters);
    WarmSolver session = WarmSolver::create(Problem::create(p.view()).value()).value();
    const Restart restart{.shift = Shift::by_stage(p.view(), steps).value()};
    Solution s = session.solve().value();
    for (int step = 0; step < control_steps; ++step) {
      parameters = examples::advance(parameters, s.z);
      p = examples::hopper(parameters);
      s = session.solve({.c0 = p.c0, .g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r}, restart).value();
      tally.add(s);
    }
  }
  print("hopper " + std::to_string(steps), tally);
}

// With `rolls_out`, each step has the roll-out of the last plan as its start.
void cart_poles(Index stages, bool rolls_out, int seeds, bool judging) {
  SessionTally tally;
  const testing::OwnedSystem owned = testing::cart_pole();
  const LCS system = LCS::create(owned.view()).value();
  for (int number = 0; number < seeds; ++number) {
    Noise noise(static_cast<std::uint64_t>(2 * number + (judging ? 2 : 1)));
    LcsPlanner planner = LcsPlanner::create(owned.view(), testing::cart_pole_task(stages)).value();
    WarmSolver session = WarmSolver::create(Problem::create(planner.problem()).value()).value();
    std::vector<double> x = {0.3 * noise.uniform(), 0.3 * noise.uniform(), noise.uniform(), noise.uniform()};
    for (int step = 0; step < 100; ++step) {
      LcsUpdate update = planner.begin({.x0 = x}).value();
      if (!rolls_out) update.restart.initial_z = {};
      const Solution s = session.solve(update.numbers, update.restart).value();
      tally.add(s, solve_in_process(planner.problem()).value());
      const LcsPlan plan =
          planner.finish({.status = s.status, .z = s.z, .detail = s.detail, .times = s.times}).value();
      const LcsTrajectory next = rollout(system, x, {plan.u.data(), 1}).value();
      x.assign(next.x.begin() + 4, next.x.end());
      if (step % 20 == 19) x[3] += noise.uniform();  // a push
    }
  }
  print("cart-pole " + std::to_string(stages) + (rolls_out ? "" : ", no start"), tally);
}

}  // namespace

void sessions(const Settings& settings) {
  std::printf("%-22s %6s %8s %6s %9s %11s %11s %6s %6s %7s %7s %11s\n", "session", "steps", "unsolved",
              "worse", "worst", "mean", "fact. sum", "median", "most", "ms", "99 %", "cold");
  const auto [seeds, judging] = std::pair(settings.seeds, settings.judging);
  const auto wants = [&](const char* part) { return settings.only.empty() || settings.only == part; };
  if (wants("random")) {
    for (const Index pairs : {1, 2, 5, 9})
      random_sessions({.variables = 12 + pairs, .inequalities = 5, .pairs = pairs}, seeds, judging);
    for (const Index pairs : {1, 5, 9})
      random_sessions({.variables = 120, .equalities = 20, .inequalities = 40, .pairs = pairs},
                      std::max(1, seeds / 10), judging);
  }
  if (wants("hoppers")) {
    hoppers(10, 60, std::max(1, seeds / 2), judging);
    hoppers(20, 60, std::max(1, seeds / 4), judging);
    hoppers(60, 40, std::max(1, seeds / 8), judging);
  }
  if (!wants("cart_poles")) return;
  for (const Index stages : {5, 10, 30}) {
    for (const bool rolls_out : {true, false}) cart_poles(stages, rolls_out, std::max(1, seeds / 4), judging);
  }
}

}  // namespace marble::suite
