// Problem files, read and written in process: every bit is kept, and nothing a file holds does harm.
#include "marble/problem_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "support/random_problem.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

std::vector<std::uint64_t> bits(const std::vector<double>& values) {
  std::vector<std::uint64_t> result(values.size());
  std::memcpy(result.data(), values.data(), values.size() * sizeof(double));
  return result;
}

void expect_same(const SparseMatrix& a, const SparseMatrix& b) {
  EXPECT_EQ(a.row_indices, b.row_indices);
  EXPECT_EQ(bits(a.values), bits(b.values));
  if (!a.values.empty()) {
    EXPECT_EQ(a.column_pointers, b.column_pointers);
  }
}

void expect_same(const OwnedProblem& a, const OwnedProblem& b) {
  EXPECT_EQ(a.name, b.name);
  for (const auto matrix :
       {&OwnedProblem::Q, &OwnedProblem::A, &OwnedProblem::C, &OwnedProblem::L, &OwnedProblem::R})
    expect_same(a.*matrix, b.*matrix);
  for (const auto vector :
       {&OwnedProblem::g, &OwnedProblem::b, &OwnedProblem::d, &OwnedProblem::l, &OwnedProblem::r})
    EXPECT_EQ(bits(a.*vector), bits(b.*vector));
  EXPECT_EQ(bits({a.c0}), bits({b.c0}));
}

class EveryFormat : public ::testing::TestWithParam<FileFormat> {
 protected:
  static OwnedProblem there_and_back(const OwnedProblem& problem) {
    const auto file = parse_problem(write_problem({problem, {}}, GetParam()), GetParam(), "unnamed");
    EXPECT_TRUE(file.has_value()) << file.error().message();
    return file->problem;
  }
};

TEST_P(EveryFormat, KeepsEveryProblem) {
  for (const auto& [problem, optimum] : small_problems()) expect_same(there_and_back(problem), problem);
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const OwnedProblem problem = random_problem({}, seed);
    expect_same(there_and_back(problem), problem);
  }
}

TEST_P(EveryFormat, KeepsEveryBitOfExtremeNumbers) {
  OwnedProblem problem;
  problem.name = "extreme \"name\" ⊥";
  using Limits = std::numeric_limits<double>;
  problem.g = {-0.0,
               0.1,
               1.0 / 3.0,
               Limits::max(),
               Limits::lowest(),
               Limits::min(),
               Limits::denorm_min(),
               -Limits::denorm_min(),
               1.0 + Limits::epsilon(),
               9007199254740993.0,
               1e22,
               123456789012345678.0};
  problem.c0 = -0.0;
  expect_same(there_and_back(problem), problem);
}

INSTANTIATE_TEST_SUITE_P(Formats, EveryFormat, ::testing::Values(FileFormat::json, FileFormat::binary),
                         [](const auto& test) { return test.index == 0 ? "Json" : "Binary"; });

Expected<ProblemFile> json(const std::string& text) { return parse_problem(text, FileFormat::json, "file"); }

TEST(ProblemFile, JsonKeepsInitialPointAndBestKnownObjective) {
  ProblemFile file{public_example().problem, 3.0};
  file.problem.initial_z = {0.1, -0.0, 1e-300, 7.0};
  const auto back = json(write_problem(file, FileFormat::json));
  ASSERT_TRUE(back.has_value()) << back.error().message();
  EXPECT_EQ(bits(back->problem.initial_z), bits(file.problem.initial_z));
  EXPECT_EQ(back->best_known_objective, 3.0);
}

TEST(ProblemFile, MissingAndNullBlocksAreEmpty) {
  const auto file = json(R"({"n": 2, "g": [1, 2], "A": null, "b": [], "x0": null, "name": null})");
  ASSERT_TRUE(file.has_value()) << file.error().message();
  EXPECT_EQ(file->problem.name, "file");
  EXPECT_EQ(file->problem.g.size(), 2U);
  EXPECT_TRUE(Problem::create(file->problem.view()).has_value());
}

TEST(ProblemFile, OtherKeysAreIgnoredWhateverTheyHold) {
  const auto file = json(
      R"({"source": {"g": [1, "x", {"n": 7}], "A": 1}, "n": 1, "list": [[[]], {"n": 0}, null, true], "g": [3],)"
      R"("Q": {"rows": 1, "cols": 1, "note": {"v": [0]}, "i": [0], "j": [0], "v": [2]}, "other": "n"})");
  ASSERT_TRUE(file.has_value()) << file.error().message();
  EXPECT_EQ(file->problem.g, std::vector<double>{3.0});
  EXPECT_EQ(file->problem.Q.values, std::vector<double>{2.0});
}

TEST(ProblemFile, EqualCoordinatesAddUp) {
  const auto file =
      json(R"({"n": 1, "g": [0], "Q": {"rows": 1, "cols": 1, "i": [0, 0], "j": [0, 0], "v": [1, 2]}})");
  ASSERT_TRUE(file.has_value()) << file.error().message();
  EXPECT_EQ(file->problem.Q.values, std::vector<double>{3.0});
}

TEST(ProblemFile, AFaultOfASumIsNamedWhereTheFileHasIt) {
  const auto file = json(
      R"({"n": 2, "g": [0, 0], "Q": {"rows": 2, "cols": 2, "i": [1, 0, 0], "j": [1, 0, 0], "v": [1, 1e308, 1e308]}})");
  ASSERT_FALSE(file.has_value());
  EXPECT_EQ(file.error().field, "Q.v");
  EXPECT_GE(file.error().index, 1);
  EXPECT_NE(file.error().bound.find("finite"), std::string::npos) << file.error().bound;
}

TEST(ProblemFile, AsymmetryIsNamedWhereTheFileHasIt) {
  const auto file = json(
      R"({"n": 2, "g": [0, 0], "Q": {"rows": 2, "cols": 2, "i": [1, 0, 0], "j": [1, 0, 1], "v": [1, 1, 4]}})");
  ASSERT_FALSE(file.has_value());
  EXPECT_EQ(file.error().field, "Q.v");
  EXPECT_EQ(file.error().index, 2);
  EXPECT_NE(file.error().bound.find("(0, 1)"), std::string::npos) << file.error().bound;
}

TEST(ProblemFile, BinaryErrorsNameTheMessagesFields) {
  OwnedProblem problem = public_example().problem;
  problem.A.row_indices[0] = 7;
  const auto file =
      parse_problem(write_problem({problem, {}}, FileFormat::binary), FileFormat::binary, "file");
  ASSERT_FALSE(file.has_value());
  EXPECT_EQ(file.error().message(), "equality_matrix.row_indices[0] = 7: must be in [0, 1)");
}

TEST(ProblemFile, AnUpperTriangleIsWrittenInFullInJson) {
  OwnedProblem problem;
  problem.g = {0.0, 0.0};
  problem.Q = {2, 2, {0, 1, 3}, {0, 0, 1}, {2.0, 1.0, 2.0}};
  problem.hessian_form = HessianForm::upper_triangle;
  const auto file = json(write_problem({problem, {}}, FileFormat::json));
  ASSERT_TRUE(file.has_value()) << file.error().message();
  EXPECT_EQ(file->problem.hessian_form, HessianForm::full);
  EXPECT_EQ(file->problem.Q.values, (std::vector<double>{2.0, 1.0, 1.0, 2.0}));
}

TEST(ProblemFile, EveryTruncationOfJsonIsAnError) {
  const std::string whole = write_problem({public_example().problem, 3.0}, FileFormat::json);
  for (std::size_t length = 0; length + 1 < whole.size(); ++length)  // the last byte is a line break
    EXPECT_FALSE(json(whole.substr(0, length)).has_value()) << length;
}

TEST(ProblemFile, ATruncatedMessageIsAnErrorOrAWholeProblem) {
  // Where a field ends, what is left is a message again; its problem lacks the last blocks.
  const std::string whole = write_problem({public_example().problem, {}}, FileFormat::binary);
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const auto file = parse_problem(whole.substr(0, length), FileFormat::binary, "file");
    if (file) {
      EXPECT_TRUE(file->problem.r.empty()) << length;
    }
  }
  EXPECT_FALSE(parse_problem(whole.substr(0, whole.size() - 1), FileFormat::binary, "file").has_value());
}

TEST(ProblemFile, NoChangedByteDoesHarm) {
  for (const FileFormat format : {FileFormat::json, FileFormat::binary}) {
    const std::string whole = write_problem({public_example().problem, 3.0}, format);
    for (std::size_t position = 0; position < whole.size(); ++position) {
      for (const char byte : {'\0', '9', '-', '[', '}', '"', '\x7f', '\xff'}) {
        std::string changed = whole;
        changed[position] = byte;
        const auto file = parse_problem(changed, format, "file");
        if (file) {
          EXPECT_TRUE(Problem::create(file->problem.view()).has_value());
        } else {
          EXPECT_FALSE(file.error().message().empty());
        }
      }
    }
  }
}

}  // namespace
}  // namespace marble::testing
