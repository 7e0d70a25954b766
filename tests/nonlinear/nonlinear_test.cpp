// What the sequence of LCQPs promises, of problems whose optima are known.
#include "marble/nonlinear.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "formula.h"

namespace marble::testing {
namespace {

using nonlinear::Answer;
using nonlinear::Curvature;
using nonlinear::Iteration;
using nonlinear::Settings;

Expected<Answer> solved_locally(const nonlinear::Problem& problem, const Settings& settings = {}) {
  return nonlinear::solve(problem, nonlinear::open_ticks_in_process, settings);
}

std::vector<Iteration> table_of(const nonlinear::Problem& problem, Settings settings = {}) {
  std::vector<Iteration> rows;
  settings.iteration = [&rows](const Iteration& row) { rows.push_back(row), rows.back().x = {}; };
  EXPECT_TRUE(solved_locally(problem, settings).has_value());
  return rows;
}

void expect_known_optimum(const Formula& formula, const Expected<Answer>& answer, double tolerance) {
  ASSERT_TRUE(answer.has_value()) << formula.name << ": " << answer.error().message();
  EXPECT_EQ(answer->status, Status::solved) << formula.name << ": " << answer->detail;
  EXPECT_NEAR(answer->objective, formula.optimum, tolerance * std::max(1.0, std::abs(formula.optimum)))
      << formula.name;
  EXPECT_EQ(objection(formula, *answer), "") << formula.name;
  EXPECT_EQ(answer->b_stationary, true) << formula.name;
  EXPECT_LT(answer->kkt_residual, 1e-6 * std::max(1.0, std::abs(formula.optimum))) << formula.name;
}

Formula named(const std::vector<Formula>& formulas, const std::string& name) {
  return *std::find_if(formulas.begin(), formulas.end(),
                       [&](const Formula& one) { return one.name == name; });
}

TEST(Nonlinear, TheLecturesExampleEndsAtItsSolutionFromEveryStart) {
  for (const Formula& formula : classical_problems()) {
    if (!formula.name.starts_with("murty")) continue;
    const auto answer = solved_locally(problem_of(formula));
    ASSERT_TRUE(answer.has_value());
    EXPECT_NEAR(answer->x[0], 1.0, 1e-8);
    EXPECT_NEAR(answer->x[1], 3.0, 1e-8);
    EXPECT_NEAR(answer->multipliers.equalities[0], 1.0, 1e-6);
    EXPECT_NEAR(answer->multipliers.inequalities[0], 1.0, 1e-6);
    EXPECT_NEAR(answer->multipliers.inequalities[1], 0.0, 1e-6);
    EXPECT_LE(answer->iterations, 8) << formula.name;
  }
}

TEST(Nonlinear, ClassicalProblemsEndAtTheirOptima) {
  for (const Formula& formula : classical_problems()) {
    const auto problem = problem_of(formula);
    const auto agree = nonlinear::check_derivatives(problem, formula.start);
    EXPECT_TRUE(agree.has_value()) << formula.name << ": " << agree.error().message();
    expect_known_optimum(formula, solved_locally(problem), 1e-6);
    expect_known_optimum(formula, solved_locally(problem_of(formula, false)), 1e-6);  // damped BFGS
  }
}

TEST(Nonlinear, EquilibriumProblemsEndAtTheirBestKnownObjectives) {
  std::vector<int> ticks;
  for (const Formula& formula : equilibrium_problems()) {
    const auto problem = problem_of(formula);
    const auto agree = nonlinear::check_derivatives(problem, formula.start);
    EXPECT_TRUE(agree.has_value()) << formula.name << ": " << agree.error().message();
    const auto answer = solved_locally(problem);
    ASSERT_TRUE(answer.has_value()) << formula.name << ": " << answer.error().message();
    ticks.push_back(answer->ticks);
    expect_known_optimum(formula, answer, 1e-4);
  }
  EXPECT_GE(ticks.size(), 40u);
  std::sort(ticks.begin(), ticks.end());
  EXPECT_LE(ticks[ticks.size() / 2], 10);
}

TEST(Nonlinear, ConvergesQuadraticallyWithTheExactHessian) {
  const auto check = [](const Formula& formula) {
    std::vector<std::vector<double>> path;
    Settings settings;
    settings.iteration = [&](const Iteration& row) { path.emplace_back(row.x.begin(), row.x.end()); };
    const auto answer = solved_locally(problem_of(formula), settings);
    ASSERT_TRUE(answer.has_value());
    std::vector<double> errors;
    for (const auto& x : path) {
      double error = 0.0;
      for (std::size_t j = 0; j < x.size(); ++j) error = std::max(error, std::abs(x[j] - answer->x[j]));
      errors.push_back(error);
    }
    int seen = 0;
    for (std::size_t k = 0; k + 1 < errors.size(); ++k) {
      if (errors[k] > 0.05) continue;
      EXPECT_LE(errors[k + 1], 20.0 * errors[k] * errors[k] + 1e-12) << formula.name << " at " << k;
      ++seen;
    }
    EXPECT_GE(seen, 1) << formula.name;
  };
  for (const char* name : {"bt6", "hs77", "hs78", "hs71"}) check(named(classical_problems(), name));
  for (const char* name : {"outrata31", "outrata32", "outrata33"}) check(named(equilibrium_problems(), name));
}

TEST(Nonlinear, ConvergesSuperlinearlyByUpdatesOfTheCurvature) {
  const auto rows = table_of(problem_of(named(classical_problems(), "bt6"), false));
  ASSERT_GE(rows.size(), 3u);
  const auto last = rows.back().step, before = rows[rows.size() - 3].step;
  EXPECT_LT(last, 0.02 * before);
}

// The sum of two chains of stages; nothing couples stages but equalities that are linear in the later one.
TEST(Nonlinear, UpdatesStayInTheBlocksOfTheStages) {
  constexpr std::size_t kStages = 8;
  Formula chain{.name = "chain", .start = std::vector<double>(3 * kStages, 0.1), .parts = [](const Jets& x) {
                  Parts made;
                  for (std::size_t k = 0; k < kStages; ++k) {
                    const Jet &a = x[3 * k], &b = x[3 * k + 1], &u = x[3 * k + 2];
                    made.objective += pow(a - 1, 4) + square(b) + 0.1 * square(u) + 0.1 * exp(a * 0.5 + u);
                    if (k + 1 == kStages) break;
                    made.equalities.push_back(x[3 * k + 3] - a - 0.3 * b);
                    made.equalities.push_back(x[3 * k + 4] - b - 0.3 * (u - sin(a)));
                  }
                  return made;
                }};
  auto problem = problem_of(chain, false);
  problem.blocks.assign(kStages, 3);
  std::size_t entries = 0;
  const nonlinear::OpenTicks open = [&](const ProblemView& view, const Settings& settings) {
    entries = view.Q.values.size();
    return nonlinear::open_ticks_in_process(view, settings);
  };
  const auto by_blocks = nonlinear::solve(problem, open);
  const auto exact = solved_locally(problem_of(chain));
  ASSERT_TRUE(by_blocks && exact);
  EXPECT_EQ(entries, kStages * 6);
  EXPECT_EQ(by_blocks->status, Status::solved) << by_blocks->detail;
  EXPECT_NEAR(by_blocks->objective, exact->objective, 1e-8);
}

// A session whose first answer is spoilt; it notes from where it was asked again.
class Spoilt final : public nonlinear::Ticks {
 public:
  Spoilt(std::unique_ptr<nonlinear::Ticks> sound, void (*spoil)(Solution&), std::vector<bool>& from_no_step)
      : sound_(std::move(sound)), spoil_(spoil), from_no_step_(from_no_step) {}

  Expected<Solution> solve(const ProblemUpdate& update, const nonlinear::TickControls& controls) override {
    const auto& z = controls.initial_z;
    from_no_step_.push_back(controls.cold && !z.empty() &&
                            std::ranges::all_of(z, [](double d) { return d == 0.0; }));
    auto solution = sound_->solve(update, controls);
    if (solution && from_no_step_.size() == 1) spoil_(*solution);
    return solution;
  }

 private:
  std::unique_ptr<nonlinear::Ticks> sound_;
  void (*spoil_)(Solution&);
  std::vector<bool>& from_no_step_;
};

TEST(Nonlinear, AStepThatLosesAFeasiblePointIsAskedForAgainFromThere) {
  Formula corner{.name = "corner", .start = {0, 0.5}, .parts = [](const Jets& x) {
                   Parts made;
                   made.objective = square(x[0] - 2) + square(x[1] - 1) + 0.1 * exp(x[0]);
                   made.G = {x[0]}, made.H = {x[1]};
                   return made;
                 }};
  void (*const spoils[])(Solution&) = {[](Solution& s) { s.status = Status::locally_infeasible; },
                                       [](Solution& s) { s.objective += 100.0; }, [](Solution&) {}};
  for (const auto spoil : spoils) {
    std::vector<bool> from_no_step;
    const nonlinear::OpenTicks open = [&](const ProblemView& view, const Settings& settings) {
      auto sound = nonlinear::open_ticks_in_process(view, settings);
      return sound ? Expected<std::unique_ptr<nonlinear::Ticks>>(
                         std::make_unique<Spoilt>(std::move(*sound), spoil, from_no_step))
                   : std::move(sound);
    };
    const auto answer = nonlinear::solve(problem_of(corner), open);
    ASSERT_TRUE(answer.has_value());
    EXPECT_EQ(answer->status, Status::solved) << answer->detail;
    ASSERT_GE(from_no_step.size(), 2U);
    EXPECT_EQ(std::ranges::count(from_no_step, true), spoil == spoils[2] ? 0 : 1);
    EXPECT_EQ(from_no_step[1], spoil != spoils[2]);
  }
}

TEST(Nonlinear, LinearProgramsWithPairsEndAtAVertex) {
  const auto formulas = equilibrium_problems();
  for (const char* name : {"scholtes4", "ralph1", "bard91", "kth1"}) {
    const Formula formula = named(formulas, name);
    bool curved = false;
    const nonlinear::OpenTicks open = [&](const ProblemView& view, const Settings& settings) {
      for (const double value : view.Q.values) curved |= value != 0.0;
      return nonlinear::open_ticks_in_process(view, settings);
    };
    expect_known_optimum(formula, nonlinear::solve(problem_of(formula), open, {.curvature = Curvature::none}),
                         1e-6);
    EXPECT_FALSE(curved) << name;
  }
}

// The distances of a point on a wall or floor to three others.
TEST(Nonlinear, ResidualsNeedNoHessian) {
  const Formula formula{
      .name = "distances", .start = {1, 1}, .parts = [](const Jets& x) {
        Parts made;
        for (const auto& [a, b, far] : {std::tuple{3.0, 1.0, 2.5}, {2.0, -2.0, 2.1}, {-1.0, 1.0, 3.1}})
          made.residuals.push_back(square(x[0] - a) + square(x[1] - b) - far * far);
        made.G = {x[0]}, made.H = {x[1]};
        return made;
      }};
  const auto exact = solved_locally(problem_of(formula));
  const auto answer = solved_locally(problem_of(formula, false), {.curvature = Curvature::automatic});
  ASSERT_TRUE(answer && exact);
  EXPECT_EQ(answer->status, Status::solved) << answer->detail;
  EXPECT_NEAR(answer->objective, exact->objective, 1e-8);
  EXPECT_EQ(objection(formula, *answer), "");
}

Formula circle(
    double angle) {  // Maratos: every full step towards the solution makes merit and violation worse
  return {.name = "maratos",
          .optimum = -1,
          .start = {std::cos(angle), std::sin(angle)},
          .parts = [](const Jets& x) -> Parts {
            const Jet outside = square(x[0]) + square(x[1]) - 1;
            return {.objective = 2 * outside - x[0], .equalities = {outside}};
          }};
}

TEST(Nonlinear, ACorrectionTakesTheStepThatTheMeritRefuses) {
  const auto rows = table_of(problem_of(circle(0.8)));
  EXPECT_TRUE(std::any_of(rows.begin(), rows.end(),
                          [](const Iteration& row) { return row.corrected && row.accepted; }));
  EXPECT_LE(rows.size(), 8u);
  expect_known_optimum(circle(0.8), solved_locally(problem_of(circle(0.8))), 1e-8);
}

const Formula kFar{.name = "far", .optimum = 1000, .start = {0}, .parts = [](const Jets& x) -> Parts {
                     return {.objective = 100 * x[0], .inequalities = {x[0] - 10 + 0.001 * sin(x[0])}};
                   }};

TEST(Nonlinear, AFarFeasiblePointIsReachedByElasticSteps) {
  const auto problem = problem_of(kFar);
  const Settings narrow{.largest_radius = 2.0};
  const auto rows = table_of(problem, narrow);
  EXPECT_TRUE(rows.front().elastic);
  EXPECT_EQ(rows.front().radius, 1.0);
  expect_known_optimum(kFar, solved_locally(problem, narrow), 1e-3);
}

TEST(Nonlinear, AFirstRadiusWithinWhichNoRowsAreMetGrows) {
  const auto problem = problem_of(kFar);
  const auto rows = table_of(problem);
  EXPECT_FALSE(rows.front().elastic);
  EXPECT_EQ(rows.front().radius, 10.0);
  EXPECT_GE(rows.front().ticks, 2);
  EXPECT_LT(rows.size(), table_of(problem, {.largest_radius = 1.0}).size());
  expect_known_optimum(kFar, solved_locally(problem), 1e-3);

  const Formula never{.name = "never", .start = {5}, .parts = [](const Jets& x) -> Parts {
                        return {.objective = x[0], .inequalities = {x[0] - 1, -1 - x[0]}};
                      }};
  const auto last = table_of(problem_of(never));
  EXPECT_TRUE(last.front().elastic);
  EXPECT_EQ(last.front().radius, 1.0);  // that of the settings again
}

TEST(Nonlinear, WhereTheViolationCannotBeLoweredItSaysSo) {
  const Formula none{.name = "none", .start = {3}, .parts = [](const Jets& x) -> Parts {
                       return {.objective = x[0], .equalities = {square(x[0]) + 1}};
                     }};
  const auto answer = solved_locally(problem_of(none));
  ASSERT_TRUE(answer.has_value());
  EXPECT_EQ(answer->status, Status::locally_infeasible) << answer->detail;
  EXPECT_NEAR(answer->violation, 1.0, 1e-3);
  EXPECT_FALSE(answer->b_stationary.has_value());
}

TEST(Nonlinear, RowsThatContradictEachOtherWithinTheToleranceAreMet) {
  const Formula twice{
      .name = "twice", .optimum = 2, .start = {3}, .parts = [](const Jets& x) -> Parts {
        return {.objective = 2 * x[0], .equalities = {square(x[0]) - 1, square(x[0]) - 1 - 1e-7}};
      }};
  const auto answer = solved_locally(problem_of(twice));
  ASSERT_TRUE(answer.has_value());
  EXPECT_EQ(answer->status, Status::solved) << answer->detail;
  EXPECT_NEAR(answer->objective, 2.0, 1e-6);
  EXPECT_EQ(objection(twice, *answer), "");
}

TEST(Nonlinear, AHessianThatIsNotConvexLeadsToAMinimum) {
  const Formula saddle{.name = "saddle",
                       .optimum = -std::cosh(1.0) - 1,
                       .start = {0.1, -0.1},
                       .parts = [](const Jets& x) -> Parts {
                         return {.objective = -0.5 * (exp(x[0]) + exp(-x[0])) - square(x[1])};
                       },
                       .lower = {-1, -1},
                       .upper = {1, 1}};
  expect_known_optimum(saddle, solved_locally(problem_of(saddle)), 1e-8);
}

TEST(Nonlinear, AStepToWhereAFunctionIsNoNumberIsShortened) {
  const Formula barrier{.name = "log", .optimum = 1, .start = {20}, .parts = [](const Jets& x) -> Parts {
                          return {.objective = x[0] - log(x[0])};
                        }};
  expect_known_optimum(barrier, solved_locally(problem_of(barrier), {.radius = 100}), 1e-8);
}

TEST(Nonlinear, ItsLimitsAreSaid) {
  const auto problem = problem_of(named(classical_problems(), "bt6"));
  const auto few = solved_locally(problem, {.iteration_limit = 2});
  ASSERT_TRUE(few.has_value());
  EXPECT_EQ(few->status, Status::iteration_limit);
  EXPECT_EQ(few->iterations, 2);
  const auto short_time = solved_locally(problem, {.time_limit_s = 1e-9});
  ASSERT_TRUE(short_time.has_value());
  EXPECT_EQ(short_time->status, Status::time_limit);
  std::stop_source stop;
  const auto stopped = solved_locally(problem, {.iteration =
                                                    [&](const Iteration& row) {
                                                      if (row.iteration == 1) stop.request_stop();
                                                    },
                                                .stop = stop.get_token()});
  ASSERT_TRUE(stopped.has_value());
  EXPECT_EQ(stopped->status, Status::cancelled);
  EXPECT_EQ(stopped->iterations, 2);
}

struct Fault {
  std::string field;
  std::int64_t index;
  std::function<void(nonlinear::Problem&)> make;
};

// bard1 with one thing wrong.
TEST(Nonlinear, BadFunctionsAreRefusedByName) {
  const Formula formula = named(equilibrium_problems(), "bard1");
  static std::vector<double> kept;
  static SparseMatrix matrix;
  static int calls;
  const auto in_values = [](auto change) {
    return [change](nonlinear::Problem& p) {
      p.values = [change, whole = p.values](std::span<const double> x) {
        nonlinear::Values at = whole(x);
        change(at);
        return at;
      };
    };
  };
  const auto in_G = [](auto change) {
    return [change](nonlinear::Problem& p) {
      p.derivatives = [change, whole = p.derivatives](std::span<const double> x) {
        nonlinear::Derivatives at = whole(x);
        matrix = {at.G.rows,
                  at.G.columns,
                  {at.G.column_pointers.begin(), at.G.column_pointers.end()},
                  {at.G.row_indices.begin(), at.G.row_indices.end()},
                  {at.G.values.begin(), at.G.values.end()}};
        change(matrix);
        at.G = matrix.view();
        return at;
      };
    };
  };
  const double nan = std::nan("");
  const std::vector<Fault> faults = {
      {"values.objective", -1, in_values([=](nonlinear::Values& at) { at.objective = nan; })},
      {"values.G", 1, in_values([=](nonlinear::Values& at) {
         kept.assign(at.G.begin(), at.G.end()), kept[1] = nan, at.G = kept;
       })},
      {"values.H", -1, in_values([](nonlinear::Values& at) { at.H = at.H.first(2); })},
      {"values.equalities", -1, in_values([](nonlinear::Values& at) {
         if (calls++ > 0) at.equalities = {};
       })},
      {"derivatives.G", 2, in_G([=](SparseMatrix& G) { G.values[5] = nan; })},
      {"derivatives.G.rows", -1, in_G([](SparseMatrix& G) { G.rows = 2; })},
      {"derivatives.G.row_indices", 1, in_G([](SparseMatrix& G) { G.row_indices[1] = 0; })},
      {"derivatives.G.column_pointers", 1, in_G([](SparseMatrix& G) {
         if (calls++ == 0) return;
         G.values.erase(G.values.begin()), G.row_indices.erase(G.row_indices.begin());
         for (std::size_t j = 1; j < G.column_pointers.size(); ++j) --G.column_pointers[j];
       })},
      {"derivatives.gradient", -1,
       [](nonlinear::Problem& p) {
         p.derivatives = [whole = p.derivatives](std::span<const double> x) {
           nonlinear::Derivatives at = whole(x);
           at.gradient = at.gradient.first(3);
           return at;
         };
       }},
      {"lower", 1,
       [](nonlinear::Problem& p) {
         p.upper = {9, -1, 9, 9, 9};
       }},
      {"scale", -1,
       [](nonlinear::Problem& p) {
         p.scale = {1, 1};
       }},
      {"blocks", 0,
       [](nonlinear::Problem& p) {
         p.blocks = {0, 5};
       }},
      {"start", -1, [](nonlinear::Problem& p) { p.start.clear(); }},
      {"derivatives", -1, [](nonlinear::Problem& p) { p.derivatives = {}; }},
  };
  for (const Fault& fault : faults) {
    auto problem = problem_of(formula);
    fault.make(problem);
    calls = 0;
    const auto answer = solved_locally(problem);
    ASSERT_FALSE(answer.has_value()) << fault.field;
    EXPECT_EQ(answer.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(answer.error().field, fault.field);
    EXPECT_EQ(answer.error().index, fault.index) << answer.error().message();
  }
  EXPECT_EQ(solved_locally(problem_of(formula), {.radius = 0}).error().field, "settings.radius");
  EXPECT_EQ(solved_locally(problem_of(formula, false), {.curvature = Curvature::exact}).error().field,
            "hessian");
}

TEST(Nonlinear, AWrongDerivativeIsFoundByDifferences) {
  auto problem = problem_of(named(equilibrium_problems(), "outrata31"));
  problem.derivatives = [whole = problem.derivatives](std::span<const double> x) {
    nonlinear::Derivatives at = whole(x);
    static std::vector<double> wrong;
    wrong.assign(at.H.values.begin(), at.H.values.end());
    wrong[6] += 0.1;  // row 2, column 1
    at.H.values = wrong;
    return at;
  };
  const auto agree = nonlinear::check_derivatives(problem, problem.start);
  ASSERT_FALSE(agree.has_value());
  EXPECT_EQ(agree.error().field, "derivatives.H");
  EXPECT_EQ(agree.error().index, 2);
  EXPECT_NE(agree.error().bound.find("column 1"), std::string::npos) << agree.error().message();
}

}  // namespace
}  // namespace marble::testing
