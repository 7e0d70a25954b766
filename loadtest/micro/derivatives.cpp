// Measures the cost of a solution's derivatives, relative to the back-substitution (with its refinement) of
// every step of a solve, and to the control step that they come with. Measurements alternate because machines
// are noisy.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <ctime>

#include "branch/branch_point.h"
#include "marble/sensitivity.h"
#include "marble/warm_solver.h"
#include "model/tuning.h"
#include "problems.h"

namespace {

using namespace marble;

constexpr Index kAsked = 32;  // rows, directions or losses at once

/// Rows of the first variables, directions of the offsets b or losses of z: all dense enough not to be a
/// special case.
struct Asked {
  explicit Asked(const OwnedProblem& p) : b(p.b.size() * kAsked), z(p.g.size() * kAsked) {
    const auto n = static_cast<Index>(p.g.size());
    for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::sin(static_cast<double>(i));
    for (std::size_t i = 0; i < z.size(); ++i) z[i] = std::cos(static_cast<double>(i));
    Triplets entries;
    for (Index i = 0; i < kAsked; ++i) entries.add(i, i, 1.0), entries.add(i, n - 1 - i, 1.0);
    E = compress(kAsked, n, entries, "E").value();
    rows.rows = RowsRequest{.E = E.view()};
    directions.directions = {kAsked, {.b = b}};
    losses.losses = {kAsked, {.z = z}};
  }
  Asked(const Asked&) = delete;
  Asked& operator=(const Asked&) = delete;

  std::vector<double> b, z;
  SparseMatrix E;
  SensitivityRequest rows, directions, losses;
};

/// Solves repeatedly with the factor of a branch.
class BackSubstitution {
 public:
  BackSubstitution(const OwnedProblem& p, const Solution& answer)
      : problem_(scale(Problem::create(p.view()).value(), Options().scaling_passes)),
        kkt_(make_kkt(problem_)),
        point_(problem_, *kkt_),
        x_(Vector::Ones(problem_.variables())),
        y_(Vector::Ones(problem_.equalities())) {
    Iterate solution(problem_);
    take(problem_, answer, solution);
    point_.start_from_solution(solution);
    const Options options;
    const SolveControls controls;
    Run run(options, controls);
    ready_ = point_.factor(run, tuning::exact_rho, tuning::exact_delta);
  }
  [[nodiscard]] bool ready() const { return ready_; }
  void solve() {
    x_.setOnes(), y_.setOnes();
    benchmark::DoNotOptimize(kkt_->solve(x_, y_));
  }

 private:
  ScaledProblem problem_;
  std::unique_ptr<Kkt> kkt_;
  BranchPoint point_;
  Vector x_, y_;
  bool ready_ = false;
};

// For this thread: other programs do not count.
double seconds(const auto& work) {
  const auto now = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  const double begin = now();
  work();
  return now() - begin;
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void compare(benchmark::State& state, const OwnedProblem& p, SensitivityRequest Asked::*kind) {
  const Asked asked(p);
  WarmSolver solver = WarmSolver::create(Problem::create(p.view()).value()).value();
  const Solution first = solver.solve().value();
  BackSubstitution back(p, first);
  if (!is_solved(first.status) || !back.ready()) return state.SkipWithError("no answer");
  std::vector<double> with, without, one;
  Solution last;
  for (auto _ : state) {
    with.push_back(seconds([&] { last = solver.solve({}, {}, {.sensitivity = &(asked.*kind)}).value(); }));
    without.push_back(seconds([&] { benchmark::DoNotOptimize(solver.solve().value()); }));
    one.push_back(seconds([&] {
      for (Index i = 0; i < kAsked; ++i) back.solve();
    }));
  }
  if (!last.sensitivity->has_value())
    return state.SkipWithError((*last.sensitivity).error().message().c_str());
  state.counters["factorizations"] = (*last.sensitivity)->factorizations;
  state.counters["solves_each"] = static_cast<double>((*last.sensitivity)->back_substitutions) / kAsked;
  state.counters["of_a_back_substitution"] = (median(with) - median(without)) / median(one);
  state.counters["of_the_tick"] = (median(with) - median(without)) / median(without);
  state.SetLabel("n = " + std::to_string(p.g.size()) + ", 32 at once");
}

void BM_RowsHopper(benchmark::State& state) { compare(state, micro::hopper(state.range(0)), &Asked::rows); }
BENCHMARK(BM_RowsHopper)->ArgName("steps")->Arg(10)->Arg(60)->Unit(benchmark::kMicrosecond);
void BM_DirectionsHopper(benchmark::State& state) {
  compare(state, micro::hopper(state.range(0)), &Asked::directions);
}
BENCHMARK(BM_DirectionsHopper)->ArgName("steps")->Arg(10)->Arg(60)->Unit(benchmark::kMicrosecond);
void BM_LossesHopper(benchmark::State& state) {
  compare(state, micro::hopper(state.range(0)), &Asked::losses);
}
BENCHMARK(BM_LossesHopper)->ArgName("steps")->Arg(10)->Arg(60)->Unit(benchmark::kMicrosecond);
void BM_RowsQpec(benchmark::State& state) { compare(state, micro::qpec(state.range(0)), &Asked::rows); }
BENCHMARK(BM_RowsQpec)->ArgName("variables")->Arg(50)->Arg(200)->Unit(benchmark::kMicrosecond);

}  // namespace
