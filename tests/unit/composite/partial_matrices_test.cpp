// Matrices that are neither empty nor complete, in every place of a problem of each kind: always an error
// that names the matrix.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "marble/composite/coupled.h"
#include "marble/composite/scenarios.h"
#include "marble/composite/segments.h"
#include "support/coupled_problems.h"
#include "support/dense_matrix.h"
#include "support/independent_check.h"
#include "support/partial_matrix.h"

namespace marble {
namespace {

using testing::matrices_of_a_problem;
using testing::partial_matrices;
using testing::PartialMatrix;
using testing::without_rows;

/// Convex, without rows of any kind.
OwnedProblem without_any_rows(Index variables) {
  OwnedProblem p;
  const auto n = static_cast<std::size_t>(variables);
  p.Q = testing::sparse(Eigen::MatrixXd::Identity(variables, variables));
  for (std::size_t j = 0; j < n; ++j) p.g.push_back(static_cast<double>(j) - 1.5);
  return p;
}

OwnedProblem with_pairs(std::uint64_t seed) {
  return testing::random_coupled({.blocks = 1, .variables = 4, .pairs = 2, .rows = 1}, seed).blocks[0];
}

// The error's field, or how the answer is wrong; empty where it is right.
std::string reported(const ProblemView& problem, const Expected<Solution>& answer) {
  if (!answer) return answer.error().field;
  if (!is_solved(answer->status)) return "not solved";
  return testing::judge(problem, *answer).infeasibility() <= 1e-6 ? "" : "a wrong answer";
}

std::string plain(const OwnedProblem& p) { return reported(p.view(), solve_in_process(p.view())); }

std::string coupled(const testing::OwnedCoupled& c) {
  const auto answer = solve_coupled(c.view());
  if (!answer) return answer.error().field;
  return reported(monolithic_problem(c.view()).view(), answer->monolithic);
}

std::string in_segments(const OwnedProblem& p) {
  const auto problem = Problem::create(p.view());
  if (!problem) return problem.error().field;
  std::vector<Index> stages;
  for (Index j = 0; j < problem->variables(); ++j) stages.push_back(j);
  const auto answer = solve_in_segments(*problem, stages, {.num_segments = 2});
  return answer ? reported(p.view(), answer->whole) : answer.error().field;
}

std::string scenarios(const OwnedProblem& p) {
  const ScenarioProblem problem{
      .base = p.view(),
      .first_stage = {0},
      .sample = [](std::int64_t) -> Expected<ScenarioNumbers> { return ScenarioNumbers{}; },
      .scenarios = 2};
  const auto answer = solve_scenarios(problem, {.max_sample_size = 2, .out_of_sample_scenarios = 0});
  return answer ? "" : answer.error().field;
}

bool names(const std::string& reported, const std::string& matrix) {
  return reported.find(matrix + ".") != std::string::npos;
}

class PartialMatrices : public ::testing::TestWithParam<PartialMatrix> {};

TEST_P(PartialMatrices, AreRefusedInEveryPlaceOfEveryProblem) {
  for (const auto& [letter, matrix] : matrices_of_a_problem()) {
    for (const OwnedProblem& good : {without_any_rows(4), with_pairs(1)}) {
      OwnedProblem bad = good;
      GetParam().make(bad.*matrix, 4);
      EXPECT_TRUE(names(plain(bad), letter)) << letter << ": " << plain(bad);
      EXPECT_TRUE(names(in_segments(bad), letter)) << letter << ": " << in_segments(bad);
      EXPECT_TRUE(names(scenarios(bad), letter)) << letter << ": " << scenarios(bad);
      testing::OwnedCoupled c = testing::random_coupled({.blocks = 2, .variables = 4}, 3);
      c.blocks[1] = bad;
      EXPECT_TRUE(names(coupled(c), "blocks[1].problem." + letter)) << letter << ": " << coupled(c);
    }
  }
}

TEST_P(PartialMatrices, AreRefusedAsCouplingWithRowsAndWithout) {
  for (const Index rows : {0, 2}) {
    testing::OwnedCoupled c =
        testing::random_coupled({.blocks = 2, .variables = 4, .pairs = 1, .rows = 2}, 4);
    c.coupling_rhs.resize(static_cast<std::size_t>(rows));
    for (SparseMatrix& coupling : c.coupling)
      if (rows == 0) coupling = {};
    ASSERT_EQ(coupled(c), "");
    GetParam().make(c.coupling[0], 4);
    EXPECT_TRUE(names(coupled(c), "blocks[0].coupling")) << rows << " rows: " << coupled(c);
  }
}

INSTANTIATE_TEST_SUITE_P(Each, PartialMatrices, ::testing::ValuesIn(partial_matrices()),
                         [](const auto& form) {
                           std::string name = form.param.name;
                           std::ranges::replace(name, ' ', '_');
                           return name;
                         });

TEST(CompleteMatricesWithoutRows, AreAsGoodAsEmptyOnes) {
  for (const auto& [letter, matrix] : matrices_of_a_problem()) {
    if (letter == "Q") continue;  // which has rows
    OwnedProblem good = without_any_rows(4);
    good.*matrix = without_rows(4);
    EXPECT_EQ(plain(good), "") << letter;
    EXPECT_EQ(in_segments(good), "") << letter;
    EXPECT_EQ(scenarios(good), "") << letter;
    testing::OwnedCoupled c = testing::random_coupled({.blocks = 2, .variables = 4}, 3);
    c.blocks[1] = good;
    EXPECT_EQ(coupled(c), "") << letter;
  }
  testing::OwnedCoupled c = testing::random_coupled({.blocks = 2, .variables = 4}, 5);
  c.coupling_rhs.clear();
  c.coupling = {without_rows(4), {}};
  EXPECT_EQ(coupled(c), "");
}

// Of each matrix at random: as it is, another form of the same, or a partial one.
TEST(PartialMatrices, AtRandomAreNeverMistakenForAnythingElse) {
  std::mt19937_64 random(11);
  const auto below = [&](std::size_t end) { return static_cast<std::size_t>(random() % end); };
  const auto forms = partial_matrices();
  for (int round = 0; round < 400; ++round) {
    testing::OwnedCoupled c =
        testing::random_coupled({.blocks = 2, .variables = 3, .pairs = 1, .rows = 1}, 20 + below(5));
    bool spoilt = false;
    const auto change = [&](SparseMatrix& m) {
      const std::size_t choice = below(8);
      if (choice == 0) {
        forms[below(forms.size())].make(m, 3), spoilt = true;
      } else if (choice < 4 && m.rows == 0) {
        m = without_rows(3);
      }
    };
    const std::size_t block = below(2);
    OwnedProblem& p = c.blocks[block];
    for (const auto& [letter, matrix] : matrices_of_a_problem()) change(p.*matrix);
    const bool problem_spoilt = spoilt;
    change(c.coupling[block]);
    const std::string of_problem = plain(p), of_coupled = coupled(c);
    EXPECT_EQ(of_problem.find('.') != std::string::npos, problem_spoilt) << round << ": " << of_problem;
    EXPECT_EQ(in_segments(p).find('.') != std::string::npos, problem_spoilt)
        << round << ": " << in_segments(p);
    EXPECT_EQ(scenarios(p).find('.') != std::string::npos, problem_spoilt) << round << ": " << scenarios(p);
    EXPECT_EQ(of_coupled.find("blocks[" + std::to_string(block) + "].") == 0, spoilt)
        << round << ": " << of_coupled;
    if (!spoilt) {
      EXPECT_EQ(of_coupled, "") << round;
    }
  }
}

}  // namespace
}  // namespace marble
