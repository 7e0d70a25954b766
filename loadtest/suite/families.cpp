#include "families.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <thread>
#include <tuple>

#include "marble/examples.h"
#include "marble/macmpec.h"
#include "noise.h"
#include "support/independent_check.h"

namespace marble::suite {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Multiplies all data except the structure of the pairs; Q by D Q D, which keeps it symmetric and definite.
OwnedProblem perturb(OwnedProblem p, double size, std::uint64_t seed) {
  Noise noise(seed);
  std::vector<double> d(p.g.size());
  for (double& factor : d) factor = noise.factor(size);
  for (Index j = 0; j < p.Q.columns; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k)
      p.Q.values[k] *= d[j] * d[p.Q.row_indices[k]];
  }
  for (auto* matrix : {&p.A, &p.C, &p.L, &p.R}) noise.apply(matrix->values, size);
  for (auto* vector : {&p.g, &p.b, &p.d, &p.l, &p.r}) noise.apply(*vector, size);
  return p;
}

double best_of(const OwnedProblem& problem, int starts) {
  Options options;
  options.num_starts = starts;
  const Solution s = solve_in_process(problem.view(), options).value();
  return is_solved(s.status) ? s.objective : kNone;
}

Record against_starts(const std::string& name, const OwnedProblem& problem, int starts) {
  return solve_and_judge(name, problem, {}, best_of(problem, starts));
}

double seconds_of(auto&& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

void must(const Expected<void>& done) {
  if (!done) throw std::runtime_error(done.error().message());
}

double infeasibility(const OwnedProblem& p, const Solution& s) {
  return testing::judge(p.view(), s).infeasibility();
}

}  // namespace

void macmpec(const Settings& settings) {
  std::vector<Record> records;
  print_header();
  for (const examples::MacmpecProblem& each : examples::macmpec()) {
    records.push_back(
        solve_and_judge(std::string(each.name), each.problem(), settings.options, each.optimum));
    print(records.back());
  }
  print_summary("macmpec", records, 1e-5);
}

void perturbed(const Settings& settings) {
  std::vector<Record> records;
  for (const examples::MacmpecProblem& each : examples::macmpec()) {
    const OwnedProblem nominal = each.problem();
    for (int seed = 1; seed <= settings.seeds; ++seed) {
      const OwnedProblem problem = perturb(nominal, 1e-3, static_cast<std::uint64_t>(seed));
      records.push_back(
          against_starts(std::string(each.name) + "~" + std::to_string(seed), problem, settings.starts));
      if (!records.back().feasible() || !(records.back().gap() <= 1e-5)) print(records.back());
    }
  }
  print_summary("macmpec, data × (1 + 1e-3 noise)", records, 1e-5);
}

void robotics(const Settings& settings) {
  // Of the hopper the best known, of the other two proved.
  const std::tuple<const char*, OwnedProblem, double> problems[] = {
      {"contact", examples::hopper(), 25.48},
      {"gates", examples::gates(), 455.86009757},
      {"rocket", examples::rocket(), 422.111673273}};
  std::vector<Record> records;
  print_header();
  for (const auto& [name, problem, reference] : problems) {
    records.push_back(solve_and_judge(name, problem, settings.options, reference));
    print(records.back());
  }
  print_summary("robotics", records, 0.1);
}

void variants(const Settings& settings) {
  const auto run = [&](const char* name, auto&& make) {
    std::vector<Record> records;
    print_header();
    for (int seed = 1; seed <= settings.seeds; ++seed) {
      records.push_back(against_starts(std::string(name) + "~" + std::to_string(seed),
                                       make(static_cast<std::uint64_t>(seed)), settings.starts));
      print(records.back());
    }
    print_summary(name, records, 0.01);
  };
  using namespace examples;
  run("hopper", [](std::uint64_t seed) { return hopper(vary(HopperParameters{}, seed)); });
  run("rocket", [](std::uint64_t seed) { return rocket(vary(RocketParameters{}, seed)); });
  run("gates", [](std::uint64_t seed) { return gates(vary(GatesParameters{}, seed)); });
}

void qpecs(const Settings& settings) {
  for (const Index size : {100, 200}) {
    std::vector<Record> records;
    print_header();
    for (int seed = 1; seed <= settings.seeds; ++seed) {
      // Few and many upper variables, no and many degenerate pairs.
      examples::QpecParameters parameters;
      parameters.upper_variables = seed % 2 == 0 ? size / 5 : size / 12;
      parameters.lower_variables = size - parameters.upper_variables;
      parameters.degenerate_pairs = (seed % 3) * size / 16;
      const OwnedProblem problem = examples::qpec(parameters, static_cast<std::uint64_t>(seed));
      records.push_back(against_starts(problem.name, problem, settings.starts));
      print(records.back());
    }
    print_summary("qpec " + std::to_string(size), records, 1e-5);
  }
}

void warm(const Settings&) {
  const std::pair<const char*, OwnedProblem> problems[] = {
      {"rocket", examples::rocket()}, {"hopper", examples::hopper()}, {"qpec", examples::qpec({}, 1)}};
  for (const auto& [name, nominal] : problems) {
    OwnedProblem p = nominal;
    Solver solver = Solver::create(Problem::create(p.view()).value()).value();
    Solution last = solver.solve().value();
    std::vector<double> factorizations, milliseconds;
    double worst = 0.0;
    int unsolved = 0;
    Noise noise(1);
    for (int step = 0; step < 20; ++step) {
      for (auto* vector : {&p.g, &p.b, &p.d, &p.l, &p.r}) noise.apply(*vector, 1e-3);
      must(solver.update({.g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r}));
      last = solver.solve({.warm_start = &last}).value();
      factorizations.push_back(last.factorizations);
      milliseconds.push_back(1e3 * last.times.solve_s);
      unsolved += !is_solved(last.status);
      worst = std::max(worst, infeasibility(p, last));
    }
    std::printf(
        "warm %-7s 20 × vectors × (1 + 1e-3 noise): factorizations median %.0f worst %.0f, ms median %.3f, "
        "unsolved %d, worst violation %.1e\n",
        name, median(factorizations), *std::ranges::max_element(factorizations), median(milliseconds),
        unsolved, worst);
  }
  std::printf("\n");
}

void mpc(const Settings&) {
  constexpr int kTicks = 50;
  examples::HopperParameters parameters;
  OwnedProblem p = examples::hopper(parameters);
  Solver solver = Solver::create(Problem::create(p.view()).value()).value();
  Solution plan = solver.solve().value();
  std::vector<double> warm_ms, cold_ms, warm_factorizations, cold_factorizations, ratio, gap;
  int unsolved = 0;
  for (int tick = 0; tick < kTicks; ++tick) {
    parameters = examples::advance(parameters, plan.z);
    p = examples::hopper(parameters);
    const Solution shifted = examples::shift_hopper(plan);
    must(solver.update({.c0 = p.c0, .g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r}));
    plan = solver.solve({.warm_start = &shifted}).value();
    const Solution cold = solver.solve().value();
    unsolved += !is_solved(plan.status) || infeasibility(p, plan) > 1e-8;
    const double better = std::min(plan.objective, cold.objective);
    gap.push_back((plan.objective - better) / std::max(1.0, std::abs(better)));
    warm_ms.push_back(1e3 * plan.times.solve_s);
    cold_ms.push_back(1e3 * cold.times.solve_s);
    ratio.push_back(cold_ms.back() / warm_ms.back());
    warm_factorizations.push_back(plan.factorizations);
    cold_factorizations.push_back(cold.factorizations);
    std::printf("tick %2d warm %12.6f %4d %8.2f ms | cold %12.6f %4d %8.2f ms | %s\n", tick, plan.objective,
                plan.factorizations, warm_ms.back(), cold.objective, cold.factorizations, cold_ms.back(),
                plan.detail.substr(0, plan.detail.find(';')).c_str());
  }
  std::printf(
      "mpc: %d ticks, %d unsolved; warm median %.2f ms %.0f factorizations, cold %.2f ms %.0f; faster "
      "median %.1f ×; above the better of both: median %.1e worst %.1e\n\n",
      kTicks, unsolved, median(warm_ms), median(warm_factorizations), median(cold_ms),
      median(cold_factorizations), median(ratio), median(gap), *std::ranges::max_element(gap));
}

void growth(const Settings&) {
  std::printf("%6s %9s %6s %10s %12s %12s\n", "steps", "variables", "fact.", "ms", "ms/fact.", "exponent");
  double last_ms = 0.0;
  for (int steps = 30; steps <= 480; steps *= 2) {
    examples::HopperParameters parameters;
    parameters.steps = steps;
    const OwnedProblem p = examples::hopper(parameters);
    Options options;
    options.max_local_search_factorizations =
        0;  // the same work at each length: the path and one exact solve
    const Solution s = solve_in_process(p.view(), options).value();
    const double each = 1e3 * s.times.solve_s / s.factorizations;
    std::printf("%6d %9zu %6d %10.2f %12.4f %12.2f\n", steps, p.g.size(), s.factorizations,
                1e3 * s.times.solve_s, each, last_ms > 0.0 ? std::log2(each / last_ms) : kNone);
    last_ms = each;
  }
  std::printf("\n");
}

void throughput(const Settings&) {
  const OwnedProblem p = examples::hopper();
  constexpr int kSolves = 12;
  const auto work = [&p](int count) {
    for (int i = 0; i < count; ++i) static_cast<void>(solve_in_process(p.view()).value());
  };
  work(1);
  const double one = seconds_of([&] { work(kSolves); });
  const double two = seconds_of([&] {
    std::jthread other([&] { work(kSolves); });
    work(kSolves);
  });
  std::printf("throughput: one thread %.2f solves/s, two threads %.2f solves/s: %.2f ×\n\n", kSolves / one,
              2 * kSolves / two, 2.0 * one / two);
}

}  // namespace marble::suite
