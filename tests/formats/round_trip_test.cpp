// What is written is read again as the same problem, bit by bit, whatever the format.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "formats.h"
#include "marble/examples.h"
#include "support/child_process.h"
#include "support/random_problem.h"
#include "support/small_problems.h"

namespace marble::formats {
namespace {

void expect_same(const SparseMatrix& a, const SparseMatrix& b, const char* name) {
  EXPECT_EQ(a.rows, b.rows) << name;
  EXPECT_EQ(a.columns, b.columns) << name;
  EXPECT_EQ(a.column_pointers, b.column_pointers) << name;
  EXPECT_EQ(a.row_indices, b.row_indices) << name;
  EXPECT_EQ(a.values, b.values) << name;
}

void expect_same(const OwnedProblem& a, const OwnedProblem& b) {
  ASSERT_EQ(b.hessian_form, HessianForm::full);
  if (a.hessian_form == HessianForm::full) expect_same(a.Q, b.Q, "Q");
  expect_same(a.A, b.A, "A");
  expect_same(a.C, b.C, "C");
  expect_same(a.L, b.L, "L");
  expect_same(a.R, b.R, "R");
  for (const auto part : {&OwnedProblem::g, &OwnedProblem::b, &OwnedProblem::d, &OwnedProblem::l,
                          &OwnedProblem::r, &OwnedProblem::initial_z})
    EXPECT_EQ(a.*part, b.*part);
  EXPECT_EQ(a.c0, b.c0);
}

class RoundTrip : public ::testing::TestWithParam<const char*> {
 protected:
  void expect_back(const OwnedProblem& problem) {
    const std::string path = directory_.file(GetParam());
    const auto written = write_any_problem({problem, std::nullopt}, path);
    ASSERT_TRUE(written.has_value()) << written.error().message();
    const auto read = read_any_problem(path);
    ASSERT_TRUE(read.has_value()) << problem.name << ": " << read.error().message();
    expect_same(problem, read->problem);
  }
  testing::TemporaryDirectory directory_;
};

TEST_P(RoundTrip, OfTheRoboticsExamples) {
  expect_back(examples::hopper());
  expect_back(examples::rocket());
}

TEST_P(RoundTrip, OfSmallProblems) {
  for (const auto& [problem, optimum] : testing::small_problems()) expect_back(problem);
}

TEST_P(RoundTrip, OfRandomProblemsWithAPointToStartFrom) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    OwnedProblem problem = testing::random_problem({}, seed);
    problem.c0 = 1.0 / 3.0;
    for (std::size_t i = 0; i < problem.g.size(); ++i)
      problem.initial_z.push_back(0.1 * static_cast<double>(i + 1));
    expect_back(problem);
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, RoundTrip, ::testing::Values("p.npz", "folder/", "p.json"),
                         [](const auto& format) {
                           return format.param[2] == 'n' ? "npz" : format.param[2] == 'j' ? "json" : "folder";
                         });

TEST(Formats, AFolderThatIsWrittenAgainHoldsTheNewProblemAlone) {
  const testing::TemporaryDirectory directory;
  const std::string folder = directory.file("problem/");
  ASSERT_TRUE(write_any_problem({examples::hopper(), std::nullopt}, folder).has_value());
  OwnedProblem small;
  small.name = "problem";
  small.Q = compress(1, 1, {}, "Q").value();
  small.A = small.C = small.L = small.R = compress(0, 1, {}, "A").value();
  small.g = {1.0};
  ASSERT_TRUE(write_any_problem({small, std::nullopt}, folder).has_value());
  const auto read = read_any_problem(folder);
  ASSERT_TRUE(read.has_value()) << read.error().message();
  EXPECT_EQ(read->problem.l.size(), 0U);
  EXPECT_EQ(read->problem.g, small.g);
}

TEST(Formats, BrokenFilesAreRefusedWithTheirReason) {
  const testing::TemporaryDirectory directory;
  const auto refused = [&](const std::string& name, const std::string& content) {
    const std::string path = directory.file(name);
    std::filesystem::create_directories(std::filesystem::path(path).parent_path());
    std::ofstream(path, std::ios::binary) << content;
    const auto read = read_any_problem(name.ends_with(".mtx") ? path.substr(0, path.rfind('/')) : path);
    return read ? std::string("taken") : read.error().message();
  };
  EXPECT_NE(refused("a.npz", "PK nonsense").find("cannot be read as an .npz file"), std::string::npos);
  // A file of MATLAB's, whatever is in it: the command that converts it is reported.
  EXPECT_EQ(refused("a.mat", "MATLAB 5.0 MAT-file"),
            ".mat: must be converted first: python3 -m marble convert " + directory.file("a.mat") + " " +
                directory.file("a.json"));
  // Other formats, and what may be done with them.
  for (const char* name : {"model.mps", "model.qps", "model.lp", "model.txt"}) {
    const std::string said = refused(name, "NAME model\nROWS\n N  cost\nENDATA\n");
    EXPECT_NE(said.find("is neither JSON nor a marble.v1.Problem message"), std::string::npos) << said;
    EXPECT_NE(said.find(".json, .pb, .bin, .npz or .nl"), std::string::npos) << said;
    EXPECT_EQ(said.find("python3 -m marble solve") == std::string::npos, std::string(name) == "model.txt")
        << said;
  }
  EXPECT_NE(refused("empty/Q.mtx", "").find("Q: is no Matrix Market file"), std::string::npos);
  const std::string banner = "%%MatrixMarket matrix coordinate real general\n";
  EXPECT_NE(
      refused("row/Q.mtx", banner + "2 2 1\n3 1 1.0\n").find("Q = line 3: must hold an integer in [1, 2]"),
      std::string::npos);
  EXPECT_NE(refused("short/Q.mtx", banner + "2 2 2\n1 1 1.0\n").find("ends too soon"), std::string::npos);
  EXPECT_NE(refused("word/Q.mtx", banner + "2 2 1\n1 1 one\n").find("line 3: must hold a number"),
            std::string::npos);
  EXPECT_NE(
      refused("complex/Q.mtx", "%%MatrixMarket matrix array complex general\n1 1\n1 0\n").find("complex"),
      std::string::npos);
  EXPECT_NE(refused("wide/Q.mtx", "%%MatrixMarket matrix array real symmetric\n1 2\n1 0\n").find("square"),
            std::string::npos);
  EXPECT_NE(refused("alone/Q.mtx", "%%MatrixMarket matrix coordinate real general\n2 2 1\n1 1 1.0\n")
                .find("g: is missing"),
            std::string::npos);
  EXPECT_FALSE(read_any_problem(directory.file("nothing.npz")).has_value());
  EXPECT_FALSE(read_any_problem(directory.file("nothing.nl")).has_value());
  EXPECT_FALSE(write_any_problem({}, directory.file("p.mat")).has_value());
}

}  // namespace
}  // namespace marble::formats
