// Compares the examples with benchmark files of another origin, if there are any: $MARBLE_SHARED or
// ../shared. Each file is a test; without the files there is none.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "marble/examples.h"
#include "marble/macmpec.h"
#include "support/shared_problems.h"

namespace marble::examples {
namespace {

using testing::read_shared;
using testing::shared_benchmarks;

// The names of the files of a folder, without extension; none if there is no folder.
std::vector<std::string> names(const char* folder) {
  std::vector<std::string> all;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(shared_benchmarks() / folder, none)) {
    if (entry.path().extension() == ".json") all.push_back(entry.path().stem());
  }
  std::ranges::sort(all);
  return all;
}

std::string file_name(const ::testing::TestParamInfo<std::string>& info) { return info.param; }

void expect_near(const std::vector<double>& ours, const std::vector<double>& theirs, const char* name) {
  ASSERT_EQ(ours.size(), theirs.size()) << name;
  for (std::size_t k = 0; k < ours.size(); ++k)
    ASSERT_NEAR(ours[k], theirs[k], 1e-12 * std::max(1.0, std::abs(theirs[k]))) << name << " " << k;
}

void expect_near(const SparseMatrix& ours, const SparseMatrix& theirs, const char* name) {
  EXPECT_EQ(ours.rows, theirs.rows) << name;
  EXPECT_EQ(ours.columns, theirs.columns) << name;
  EXPECT_EQ(ours.column_pointers, theirs.column_pointers) << name;
  EXPECT_EQ(ours.row_indices, theirs.row_indices) << name;
  expect_near(ours.values, theirs.values, name);
}

class MacmpecSource : public ::testing::TestWithParam<std::string> {};

TEST_P(MacmpecSource, HasTheSameProblem) {
  const MacmpecProblem* const found = find_macmpec(GetParam());
  ASSERT_NE(found, nullptr);
  const OwnedProblem ours = found->problem();
  const auto [theirs, optimum] =
      read_shared((shared_benchmarks() / "macmpec" / GetParam()).replace_extension(".json"));
  EXPECT_EQ(found->optimum, optimum);
  EXPECT_NEAR(ours.c0, theirs.c0, 1e-12 * std::max(1.0, std::abs(theirs.c0)));
  expect_near(ours.Q, theirs.Q, "Q");
  expect_near(ours.A, theirs.A, "A");
  expect_near(ours.C, theirs.C, "C");
  expect_near(ours.L, theirs.L, "L");
  expect_near(ours.R, theirs.R, "R");
  expect_near(ours.g, theirs.g, "g");
  expect_near(ours.b, theirs.b, "b");
  expect_near(ours.d, theirs.d, "d");
  expect_near(ours.l, theirs.l, "l");
  expect_near(ours.r, theirs.r, "r");
}

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(MacmpecSource);
INSTANTIATE_TEST_SUITE_P(SecondSource, MacmpecSource, ::testing::ValuesIn(names("macmpec")), file_name);

class RobotSource : public ::testing::TestWithParam<std::string> {};

// The same entries up to the order and the sign of rows.
void expect_same_sizes(std::vector<double> ours, std::vector<double> theirs, const char* name) {
  for (std::vector<double>* const values : {&ours, &theirs}) {
    for (double& value : *values) value = std::abs(value);
    std::ranges::sort(*values);
  }
  expect_near(ours, theirs, name);
}

TEST_P(RobotSource, HasTheNominalProblem) {
  const std::string& name = GetParam();
  ASSERT_TRUE(name == "contact" || name == "rocket" || name == "gates") << name;
  const OwnedProblem ours = name == "contact" ? hopper() : name == "rocket" ? rocket() : gates();
  const OwnedProblem theirs =
      read_shared((shared_benchmarks() / "robotics" / name).replace_extension(".json")).problem;
  EXPECT_NEAR(ours.c0, theirs.c0, 1e-9 * std::max(1.0, std::abs(theirs.c0)));
  expect_same_sizes(ours.Q.values, theirs.Q.values, "Q");
  expect_same_sizes(ours.A.values, theirs.A.values, "A");
  expect_same_sizes(ours.C.values, theirs.C.values, "C");
  expect_same_sizes(ours.L.values, theirs.L.values, "L");
  expect_same_sizes(ours.R.values, theirs.R.values, "R");
  expect_same_sizes(ours.g, theirs.g, "g");
  expect_same_sizes(ours.b, theirs.b, "b");
  expect_same_sizes(ours.d, theirs.d, "d");
  expect_same_sizes(ours.l, theirs.l, "l");
  expect_same_sizes(ours.r, theirs.r, "r");
}

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(RobotSource);
INSTANTIATE_TEST_SUITE_P(SecondSource, RobotSource, ::testing::ValuesIn(names("robotics")), file_name);

}  // namespace
}  // namespace marble::examples
