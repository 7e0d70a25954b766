#include "composite/stages.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "composite/lift.h"
#include "composite/random_scenarios.h"
#include "marble/composite/scenario_samples.h"

namespace marble {
namespace {

// The LCQP of many scenarios: what is put together of a base problem and its scenarios' numbers.
using testing::RandomScenarios;
using testing::RandomVectors;

// Plain loops over the entries, by the definition.
double cost_of(const ProblemView& p, std::span<const double> z) {
  double cost = p.c0;
  for (std::size_t i = 0; i < z.size(); ++i) cost += p.g[i] * z[i];
  for (Index j = 0; j < p.Q.columns; ++j)
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      const Index i = p.Q.row_indices[k];
      const bool doubled = p.hessian_form == HessianForm::upper_triangle && i != j;
      cost += (doubled ? 1.0 : 0.5) * p.Q.values[k] * z[i] * z[j];
    }
  return cost;
}

std::vector<double> rows_of(const SparseMatrixView& m, std::span<const double> offset,
                            std::span<const double> z) {
  std::vector<double> rows(offset.begin(), offset.end());
  for (Index j = 0; j < m.columns; ++j)
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      rows[m.row_indices[k]] += m.values[k] * z[j];
  return rows;
}

// Rows of the plan once, then those of each scenario: out of each scenario's own rows.
std::vector<double> stacked(const std::vector<std::vector<double>>& by_scenario,
                            const std::vector<char>& own) {
  std::vector<double> result;
  for (std::size_t row = 0; row < own.size(); ++row)
    if (!own[row]) result.push_back(by_scenario[0][row]);
  for (const std::vector<double>& rows : by_scenario)
    for (std::size_t row = 0; row < own.size(); ++row)
      if (own[row]) result.push_back(rows[row]);
  return result;
}

void expect_near(const std::vector<double>& a, const std::vector<double>& b, const std::string& what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-12) << what << " " << i;
}

TEST(ScenarioStages, PutTogetherTheMeanCostAndEveryScenariosRows) {
  constexpr int kScenarios = 3;
  for (const HessianForm form : {HessianForm::full, HessianForm::upper_triangle}) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      const RandomScenarios random(seed, form);
      const auto assembled = assemble_scenarios(random.problem(), kScenarios);
      ASSERT_TRUE(assembled) << assembled.error().message();
      ASSERT_TRUE(Problem::create(assembled->view()));
      RandomVectors points(seed);
      const Vector x = points.next(5), y = points.next(5 * kScenarios);
      std::vector<double> z(x.begin(), x.end());
      z.insert(z.end(), y.begin(), y.end());
      const auto stages = Stages::create(random.problem()).value();
      double cost = 0.0, weights = 0.0;
      std::vector<std::vector<double>> A, C, L, R;
      for (int s = 0; s < kScenarios; ++s) {
        const ScenarioNumbers scenario = random.scenario(s);
        const OwnedProblem alone = stages.alone(scenario);
        std::vector<double> own(10);
        for (int i = 0; i < 5; ++i) {
          own[2 * i] = x[i];
          own[2 * i + 1] = y[5 * s + i];
        }
        cost += scenario.weight * cost_of(alone.view(), own);
        weights += scenario.weight;
        A.push_back(rows_of(alone.A.view(), alone.b, own));
        C.push_back(rows_of(alone.C.view(), alone.d, own));
        L.push_back(rows_of(alone.L.view(), alone.l, own));
        R.push_back(rows_of(alone.R.view(), alone.r, own));
        // At the plan the recourse's problem is the scenario's.
        const OwnedProblem recourse = stages.recourse(scenario, std::span(z).first(5));
        const std::span<const double> own_y(y.data() + 5 * s, 5);
        EXPECT_NEAR(cost_of(recourse.view(), own_y), cost_of(alone.view(), own), 1e-12);
        const std::vector<double> there = rows_of(recourse.C.view(), recourse.d, own_y);
        for (std::size_t i = 0; i < there.size(); ++i)
          EXPECT_NEAR(there[i], C.back()[stages.inequalities.second[i]], 1e-12);
      }
      const auto own_rows = [&](const SparseMatrix& m) {
        std::vector<char> own;
        for (Index row = 0; row < m.rows; ++row) own.push_back(random.of_plan(m, row) ? 0 : 1);
        return own;
      };
      std::vector<char> own_pairs;
      for (Index row = 0; row < random.base.L.rows; ++row) own_pairs.push_back(!random.pair_of_plan(row));
      EXPECT_NEAR(cost_of(assembled->view(), z), cost / weights, 1e-12);
      expect_near(rows_of(assembled->A.view(), assembled->b, z), stacked(A, own_rows(random.base.A)), "A");
      expect_near(rows_of(assembled->C.view(), assembled->d, z), stacked(C, own_rows(random.base.C)), "C");
      expect_near(rows_of(assembled->L.view(), assembled->l, z), stacked(L, own_pairs), "L");
      expect_near(rows_of(assembled->R.view(), assembled->r, z), stacked(R, own_pairs), "R");
    }
  }
}

TEST(ScenarioStages, HaveRowsOfThePlanByScenarioWhereTheyAreNamed) {
  const RandomScenarios random(1);
  Index row = 0;
  while (row < random.base.C.rows && !random.of_plan(random.base.C, row)) ++row;
  ASSERT_LT(row, random.base.C.rows) << "the seed has such a row";
  ScenarioProblem problem = random.problem();
  const auto once = assemble_scenarios(problem, 3).value();
  problem.sample = [&](std::int64_t i) -> Expected<ScenarioNumbers> {
    ScenarioNumbers numbers = random.scenario(i);
    numbers.d[row] += static_cast<double>(i);
    return numbers;
  };
  const auto refused = assemble_scenarios(problem, 3);
  ASSERT_FALSE(refused) << "the base's number stands once";
  EXPECT_EQ(refused.error().field, "scenario[1].d");
  EXPECT_EQ(refused.error().index, row);
  problem.own_inequalities = {row};
  const auto each = assemble_scenarios(problem, 3);
  ASSERT_TRUE(each) << each.error().message();
  EXPECT_EQ(each->d.size(), once.d.size() + 2);
}

TEST(ScenarioStages, NameWhatIsWrong) {
  const RandomScenarios random(2);
  const auto field = [&](const auto& change) {
    ScenarioProblem problem = random.problem();
    change(problem);
    const auto refused = assemble_scenarios(problem, 2);
    return refused ? std::string("nothing") : refused.error().field;
  };
  EXPECT_EQ(field([](ScenarioProblem& p) { p.first_stage = {}; }), "first_stage");
  EXPECT_EQ(field([](ScenarioProblem& p) { p.first_stage = {3, 3}; }), "first_stage");
  EXPECT_EQ(field([](ScenarioProblem& p) { p.first_stage = {10}; }), "first_stage");
  EXPECT_EQ(field([](ScenarioProblem& p) { p.first_stage = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}; }), "first_stage");
  EXPECT_EQ(field([](ScenarioProblem& p) { p.own_pairs = {-1}; }), "own_pairs");
  EXPECT_EQ(field([](ScenarioProblem& p) { p.sample = nullptr; }), "sample");
  EXPECT_EQ(field([](ScenarioProblem& p) { p.scenarios = 1; }), "scenarios");
  EXPECT_EQ(field([](ScenarioProblem& p) { p.base.g = {}; }).substr(0, 5), "base.");
  const auto scenario = [&](const auto& change) {
    return field([&](ScenarioProblem& p) {
      p.sample = [&](std::int64_t i) -> Expected<ScenarioNumbers> {
        ScenarioNumbers numbers = random.scenario(i);
        if (i == 1) change(numbers);
        return numbers;
      };
    });
  };
  EXPECT_EQ(scenario([](ScenarioNumbers& n) { n.weight = 0.0; }), "scenario[1].weight");
  EXPECT_EQ(scenario([](ScenarioNumbers& n) { n.g.pop_back(); }), "scenario[1].g");
  EXPECT_EQ(scenario([](ScenarioNumbers& n) { n.R[0] = std::numeric_limits<double>::quiet_NaN(); }),
            "scenario[1].R.values");
}

double bytes_of(const OwnedProblem& p) {
  std::size_t bytes = sizeof(OwnedProblem);
  for (const auto* vector : {&p.g, &p.b, &p.d, &p.l, &p.r}) bytes += vector->capacity() * sizeof(double);
  for (const SparseMatrix* matrix : {&p.Q, &p.A, &p.C, &p.L, &p.R})
    bytes += (matrix->column_pointers.capacity() + matrix->row_indices.capacity()) * sizeof(Index) +
             matrix->values.capacity() * sizeof(double);
  return static_cast<double>(bytes);
}

TEST(ScenarioStages, EstimateTheBytesOfAnAssembledProblem) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto form = seed % 2 == 0 ? HessianForm::full : HessianForm::upper_triangle;
    const RandomScenarios random(seed, form);
    const Stages stages = Stages::create(random.problem()).value();
    for (const std::int64_t count : {1, 2, 7, 40}) {
      const OwnedProblem assembled = assemble_scenarios(random.problem(), count).value();
      const double estimate = stages.assembled_bytes(static_cast<double>(count));
      EXPECT_GE(estimate, bytes_of(assembled)) << seed << " " << count;
      EXPECT_LE(estimate, 1.2 * bytes_of(assembled) + 1000.0) << seed << " " << count;
      const SolverSizes sizes = stages.assembled_sizes(static_cast<double>(count));
      EXPECT_EQ(sizes.variables, static_cast<double>(assembled.g.size()));
      EXPECT_EQ(sizes.pairs, static_cast<double>(assembled.l.size()));
    }
  }
}

TEST(ScenarioStages, StopDuringAssembly) {
  const RandomScenarios random(1);
  const Stages stages = Stages::create(random.problem()).value();
  const std::vector<ScenarioNumbers> scenarios(50'000, random.scenario(1));
  const std::vector<double> weights(scenarios.size(), 1.0 / static_cast<double>(scenarios.size()));
  std::stop_source stop;
  stop.request_stop();
  const auto stopped = stages.assemble(scenarios, weights, Interrupt(stop.get_token()));
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, ErrorCode::cancelled);
  const auto late = stages.assemble(scenarios, weights, Interrupt({}, Interrupt::Clock::now()));
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, ErrorCode::deadline_exceeded);
}

// Scenarios as tables and as random numbers.
std::pair<double, double> mean_and_deviation(const ScenarioQuantity& quantity) {
  constexpr int kDraws = 20'000;
  double sum = 0.0, squares = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double number = scenario_draw(quantity, 5, i, 3);
    sum += number;
    squares += number * number;
  }
  const double mean = sum / kDraws;
  return {mean, std::sqrt(squares / kDraws - mean * mean)};
}

TEST(Scenarios, AreDrawnFromTheNamedDistribution) {
  using enum ScenarioDistribution;
  const auto [uniform_mean, uniform_deviation] =
      mean_and_deviation({.distribution = uniform, .location = 2.0, .scale = 6.0});
  EXPECT_NEAR(uniform_mean, 5.0, 0.05);
  EXPECT_NEAR(uniform_deviation, 6.0 / std::sqrt(12.0), 0.05);
  const auto [normal_mean, normal_deviation] =
      mean_and_deviation({.distribution = normal, .location = -1.0, .scale = 2.0});
  EXPECT_NEAR(normal_mean, -1.0, 0.06);
  EXPECT_NEAR(normal_deviation, 2.0, 0.06);
  const auto [log_mean, log_deviation] =
      mean_and_deviation({.distribution = lognormal, .location = 0.0, .scale = 0.5});
  EXPECT_NEAR(log_mean, std::exp(0.125), 0.02);
  EXPECT_NEAR(log_deviation, std::exp(0.125) * std::sqrt(std::exp(0.25) - 1.0), 0.03);
}

TEST(Scenarios, AreClippedToTheirLimits) {
  const ScenarioQuantity clipped{.distribution = ScenarioDistribution::normal, .least = -0.5, .most = 0.25};
  double least = 1.0, most = -1.0;
  for (int i = 0; i < 200; ++i) {
    const double number = scenario_draw(clipped, 1, i, 0);
    least = std::min(least, number);
    most = std::max(most, number);
  }
  EXPECT_EQ(least, -0.5);
  EXPECT_EQ(most, 0.25);
}

TEST(Scenarios, AreFunctionsOfSeedNumberAndPlaceAlone) {
  const ScenarioQuantity quantity{.distribution = ScenarioDistribution::normal};
  const double number = scenario_draw(quantity, 7, 3, 1);
  EXPECT_EQ(scenario_draw(quantity, 7, 3, 1), number);
  EXPECT_NE(scenario_draw(quantity, 8, 3, 1), number);
  EXPECT_NE(scenario_draw(quantity, 7, 4, 1), number);
  EXPECT_NE(scenario_draw(quantity, 7, 3, 2), number);
}

TEST(Scenarios, OfASamplerAreTheBasePlusGainsTimesTheNumber) {
  const testing::RandomScenarios random(3);
  ScenarioProblem problem = random.problem();
  Index row = 0;
  while (random.pair_of_plan(row)) ++row;
  const std::vector<Index> places = {row};
  const std::vector<double> one = {2.0}, cost = {-1.0};
  const ScenarioSampler sampler{
      .seed = 9,
      .quantities = {{.effects = {{{ProblemPart::l, places}, one}, {{ProblemPart::c0, {}}, cost}}},
                     {.effects = {{{ProblemPart::c0, {}}, one}}}}};
  const auto set = set_scenarios(problem, sampler);
  ASSERT_TRUE(set) << set.error().message();
  const ScenarioNumbers scenario = problem.sample(4).value();
  const double first = scenario_draw(sampler.quantities[0], 9, 4, 0);
  const double second = scenario_draw(sampler.quantities[1], 9, 4, 1);
  ASSERT_EQ(scenario.l.size(), random.base.l.size());
  EXPECT_EQ(scenario.l[row], random.base.l[row] + 2.0 * first);
  EXPECT_EQ(scenario.c0.value(), random.base.c0 - first + 2.0 * second);
  EXPECT_TRUE(scenario.g.empty()) << "what no quantity moves stays as the base has it";
}

TEST(Scenarios, OfATableAreItsRows) {
  const testing::RandomScenarios random(4);
  ScenarioProblem problem = random.problem();
  const std::vector<Index> places = {1, 3};
  const std::vector<double> values = {10.0, 30.0, 5.0, 11.0, 31.0, 6.0}, weights = {1.0, 2.0};
  const auto set = set_scenarios(
      problem,
      {.entries = {{ProblemPart::g, places}, {ProblemPart::c0, {}}}, .values = values, .weights = weights});
  ASSERT_TRUE(set) << set.error().message();
  EXPECT_EQ(problem.scenarios, 2);
  const ScenarioNumbers scenario = problem.sample(1).value();
  EXPECT_EQ(scenario.g[1], 11.0);
  EXPECT_EQ(scenario.g[3], 31.0);
  EXPECT_EQ(scenario.g[0], random.base.g[0]);
  EXPECT_EQ(scenario.c0.value(), 6.0);
  EXPECT_EQ(scenario.weight, 2.0);
}

TEST(Scenarios, MayNotChangeRowsOfThePlanAloneThatNoListNames) {
  OwnedProblem base;
  base.g = {1.0, 1.0};
  base.C = compress(2, 2, {{0, 1}, {0, 1}, {1.0, 1.0}}, "C").value();
  base.d = {0.0, 0.0};
  const std::vector<double> values = {1.0, 1.0};
  const auto field = [&](ProblemPart part, std::vector<Index> places, std::vector<Index> own) {
    ScenarioProblem problem;
    problem.base = base.view();
    problem.first_stage = {0};
    problem.own_inequalities = std::move(own);
    const auto set = set_scenarios(problem, {.entries = {{part, places}}, .values = values});
    return set ? std::string("nothing") : set.error().field + std::to_string(set.error().index);
  };
  EXPECT_EQ(field(ProblemPart::d, {}, {}), "samples.entries[0].positions0");
  EXPECT_EQ(field(ProblemPart::d, {1}, {}), "nothing");
  EXPECT_EQ(field(ProblemPart::d, {}, {0}), "nothing");
  EXPECT_EQ(field(ProblemPart::C, {0, 1}, {}), "samples.entries[0].positions0");
  EXPECT_EQ(field(ProblemPart::C, {1}, {}), "nothing");
  EXPECT_EQ(field(ProblemPart::g, {}, {}), "nothing");
  EXPECT_EQ(field(ProblemPart::b, {}, {}), "samples.entries[0].part-1");
  EXPECT_EQ(field(ProblemPart::d, {1, 1}, {}), "samples.entries[0].positions1");
}

TEST(Scenarios, ReportTheirStagesProgressAsOfOneSolve) {
  class Rows final : public ProgressSink {
   public:
    void report(const Progress& row) override { rows.push_back(without_vectors(row)); }
    std::vector<Progress> rows;
  } sink;
  const testing::RandomScenarios random(3);
  ScenarioProblem problem = random.problem();
  problem.sample = [&](std::int64_t i) -> Expected<ScenarioNumbers> {
    return ScenarioNumbers{.g = random.scenario(i).g};
  };
  const auto answer = solve_scenarios(problem, {.max_sample_size = 8}, {.progress = &sink});
  ASSERT_TRUE(answer) << answer.error().message();
  ASSERT_FALSE(sink.rows.empty());
  for (std::size_t i = 1; i < sink.rows.size(); ++i) {
    EXPECT_GE(sink.rows[i].iteration, sink.rows[i - 1].iteration);
    EXPECT_GE(sink.rows[i].factorizations, sink.rows[i - 1].factorizations);
    EXPECT_GE(sink.rows[i].stage, sink.rows[i - 1].stage);
  }
  EXPECT_EQ(sink.rows.front().scenarios, 1);
  EXPECT_LE(sink.rows.back().factorizations, answer->solution.factorizations);
  ASSERT_FALSE(answer->solution.z.empty());
  EXPECT_TRUE(std::equal(answer->x.begin(), answer->x.end(), answer->solution.z.begin()));
}

}  // namespace
}  // namespace marble
