// What a person at a terminal gets: colours where they are wanted, and Ctrl-C.
#include "terminal.h"

#include "cli_test.h"
#include "long_options.h"
#include "problems.h"

namespace marble::testing {
namespace {

class AtATerminal : public Cli {
 protected:
  std::string table(std::vector<std::string> environment) {
    const Terminal terminal;
    const Run solve = start("solve --local " + quoted(file("good.json", kGood)), "/dev/null",
                            std::move(environment), terminal.path());
    std::string text;
    const bool ended = eventually([&] {
      text += terminal.shown();
      return !solve.process->running();
    });
    EXPECT_TRUE(ended);
    return text + terminal.shown();
  }
};

TEST_F(AtATerminal, TheTableHasColours) {
  const std::string text = table({"NO_COLOR="});
  EXPECT_NE(text.find("kappa"), std::string::npos) << text;
  EXPECT_NE(text.find("\033["), std::string::npos) << text;
}

TEST_F(AtATerminal, NoColorIsHonoured) {
  const std::string text = table({"NO_COLOR=1"});
  EXPECT_NE(text.find("kappa"), std::string::npos) << text;
  EXPECT_EQ(text.find('\033'), std::string::npos) << text;
}

class CtrlC : public Cli {
 protected:
  // Solves something that takes for ever, then a small problem; interrupts once iterations are shown.
  Result interrupted(const std::string& where) {
    const Run run = start("solve --output json " + where + long_options() + " " +
                          quoted(file("long.pb", long_request().problem().SerializeAsString())) + " " +
                          quoted(file("good.json", kGood)));
    EXPECT_TRUE(eventually([&] { return read_file(run.err).find("kappa") != std::string::npos; }));
    EXPECT_TRUE(run.process->running());
    run.process->send(SIGINT);
    return run.wait();
  }
};

TEST_F(CtrlC, EndsALocalSolveWithItsBestIterate) {
  const Result result = interrupted("--local");
  EXPECT_EQ(result.exit_code, 1) << result.err.substr(0, 2000);
  const auto lines = result.lines();
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0]["status"], "cancelled");
  EXPECT_EQ(lines[0]["z"].size(), 6000U);
  EXPECT_EQ(lines[1]["error"]["code"], "cancelled");
  EXPECT_EQ(lines[1]["file"], directory_.file("good.json"));
}

TEST_F(CtrlC, GivesARemoteSolveUpAndTheServerIsFree) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--workers", "1"});
  const Result result = interrupted("--server " + server.address());
  EXPECT_EQ(result.exit_code, 1) << result.err.substr(0, 2000);
  EXPECT_NE(result.err.find("long.pb: cancelled"), std::string::npos);
  const auto lines = result.lines();
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0]["error"]["code"], "cancelled");
  EXPECT_EQ(lines[1]["error"]["code"], "cancelled");
  EXPECT_EQ(run("solve --server " + server.address() + " " + quoted(directory_.file("good.json"))).exit_code,
            0);
}

}  // namespace
}  // namespace marble::testing
