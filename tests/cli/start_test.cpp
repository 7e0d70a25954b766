// The program marble solves JSON files by itself; for all else it becomes the program with all commands.
#include <filesystem>

#include "cli_test.h"

namespace marble::testing {
namespace {

class Start : public Cli {
 protected:
  // marble without the program beside it, run as by its user.
  Result run_alone(const std::string& arguments, const std::string& environment = "") {
    const std::string alone = directory_.file("marble");
    std::filesystem::copy_file(MARBLE_BINARY, alone, std::filesystem::copy_options::skip_existing);
    const std::string out = directory_.file("alone out"), err = directory_.file("alone err");
    ChildProcess process(
        {"/bin/sh", "-c",
         environment + " exec " + quoted(alone) + " " + arguments + " >" + quoted(out) + " 2>" + quoted(err)},
        directory_.file("alone shell"));
    const int code = process.wait();
    return {code, read_file(out), read_file(err)};
  }
  // An answer without its times.
  static Json untimed(const Result& result) {
    Json answer = result.lines().at(0);
    for (const char* part : {"solve", "setup", "factorization", "line_search", "polish", "tree"})
      answer.erase(std::string(part) + "_seconds");
    return answer;
  }

  const std::string good_ = quoted(file("good.json", kGood));
};

TEST_F(Start, OfALocalSolveOfJsonLoadsNoOtherProgram) {
  const Result one = run_alone("solve --local --quiet " + good_);
  EXPECT_EQ(one.exit_code, 0) << one.err;
  EXPECT_NE(one.out.find("good: solved"), std::string::npos) << one.out;
  const Result by_name = run_alone("solve --server local --output json " + good_ + " " + good_);
  EXPECT_EQ(by_name.exit_code, 0) << by_name.err;
  EXPECT_EQ(by_name.lines().size(), 2U);
}

TEST_F(Start, OfALocalSolveLoadsNoLibraryOfTheNetwork) {
  const Result libraries = run_alone("solve --local --quiet " + good_, "LD_TRACE_LOADED_OBJECTS=1");
  ASSERT_NE(libraries.out.find("libc"), std::string::npos) << libraries.out;
  for (const char* name : {"grpc", "protobuf", "absl", "ssl", "libzip", "curses", "amplsolver"})
    EXPECT_EQ(libraries.out.find(name), std::string::npos) << libraries.out;
}

TEST_F(Start, TheSameFileHasTheSameAnswerFromBothPrograms) {
  const Result here = run("solve --local --quiet --output json " + good_);
  // Two files of which one is no JSON: the other program solves both.
  const std::string binary = quoted(directory_.file("good.pb"));
  ASSERT_EQ(run("convert " + good_ + " " + binary).exit_code, 0);
  const Result there = run("solve --local --quiet --output json " + good_ + " " + binary);
  ASSERT_EQ(there.exit_code, 0) << there.err;
  EXPECT_EQ(untimed(here), untimed(there));
}

TEST_F(Start, WithoutTheOtherProgramSaysWhichIsMissing) {
  for (const std::string& arguments :
       std::vector<std::string>{"version", "--help", "solve --help", "solve --local --no-such " + good_,
                                "solve --local " + quoted(file("good.pb", "")), "solve " + good_, ""}) {
    const Result result = run_alone(arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    EXPECT_EQ(result.out, "") << arguments;
    EXPECT_NE(result.err.find("marble-all: cannot be run: No such file or directory"), std::string::npos)
        << arguments << ": " << result.err;
  }
}

}  // namespace
}  // namespace marble::testing
