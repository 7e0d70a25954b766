#include <gtest/gtest.h>

#include <limits>

#include "marble/progress.h"

namespace marble {
namespace {

std::string csv(const Progress& row) {
  std::string text;
  append_progress_csv(row, text);
  return text;
}

TEST(ProgressCsv, TheColumnsAreAContract) {
  EXPECT_EQ(progress_csv_header(),
            "iteration,outer_iteration,objective,equality_violation,inequality_violation,"
            "complementarity_violation,kkt_residual,kappa,rho,step_length,regularization,factorizations,"
            "elapsed_s,incumbent,bound,gap,nodes,open_nodes");
}

TEST(ProgressCsv, EveryColumnStandsInItsPlaceWithEveryBit) {
  EXPECT_EQ(csv({.iteration = 3,
                 .outer_iteration = 2,
                 .objective = -0.1,
                 .violations = {1e-9, 2.5e-300, 1.0 / 3.0},
                 .kkt_residual = 4,
                 .kappa = 1e-14,
                 .rho = 1e6,
                 .step_length = 0.5,
                 .regularization = 1e-4,
                 .factorizations = 7,
                 .elapsed_s = 0.25,
                 .incumbent = -1.5,
                 .bound = -2,
                 .gap = 1.0 / 3.0,
                 .nodes = 5000000000,
                 .open_nodes = 12,
                 .z = {}}),
            "3,2,-0.1,1e-09,2.5e-300,0.3333333333333333,4,1e-14,1e+06,0.5,1e-04,7,0.25,-1.5,-2,"
            "0.3333333333333333,5000000000,12");
}

TEST(ProgressCsv, NumbersThatAreNoneAreNamed) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::string text = csv(
      {.objective = std::numeric_limits<double>::quiet_NaN(), .violations = {}, .rho = -kInfinity, .z = {}});
  EXPECT_EQ(text, "0,0,nan,0,0,0,0,0,-inf,0,0,0,0,inf,-inf,inf,0,0");
}

TEST(ProgressCsv, WhatIsReadByTheColumnsIsWhatWasWritten) {
  Progress copy;
  const Progress row{.iteration = 9,
                     .objective = 0.1,
                     .violations = {1, 2, 3},
                     .elapsed_s = 5e-5,
                     .bound = -7,
                     .nodes = 4,
                     .z = {}};
  for (const ProgressColumn& column : progress_columns()) column.set(copy, column.get(row));
  EXPECT_EQ(csv(copy), csv(row));
}

}  // namespace
}  // namespace marble
