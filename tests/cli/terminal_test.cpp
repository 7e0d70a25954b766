// What a person at a terminal gets: colours where they are wanted, and Ctrl-C.
#include <poll.h>

#include "cli_test.h"
#include "long_options.h"
#include "problems.h"

namespace marble::testing {
namespace {

/// Both ends of a terminal.
class Terminal {
 public:
  Terminal() : keyboard_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
    if (keyboard_ < 0 || grantpt(keyboard_) != 0 || unlockpt(keyboard_) != 0)
      throw std::runtime_error("no terminal to be had");
    path_ = ptsname(keyboard_);
    screen_ = open(path_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);  // keeps it alive when the program ends
  }
  ~Terminal() {
    close(screen_);
    close(keyboard_);
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  [[nodiscard]] const std::string& path() const { return path_; }
  /// What was written since the last call.
  [[nodiscard]] std::string shown() const {
    std::string text;
    pollfd ready{keyboard_, POLLIN, 0};
    char chunk[4096];
    while (poll(&ready, 1, 0) == 1 && (ready.revents & POLLIN) != 0) {
      const auto count = read(keyboard_, chunk, sizeof chunk);
      if (count <= 0) break;
      text.append(chunk, static_cast<std::size_t>(count));
    }
    return text;
  }

 private:
  int keyboard_, screen_ = -1;
  std::string path_;
};

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
