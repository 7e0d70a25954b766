#include "terminal.h"

#include <regex>

#include "cli_test.h"
#include "long_options.h"
#include "problems.h"

namespace marble::testing {
namespace {

// What a person at a terminal gets: colours where they are wanted, and Ctrl-C.
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

// `marble watch` at a terminal: the real program on a real terminal, looked at as a person would.
constexpr const char* kAlternateScreen = "\033[?1049h";
constexpr const char* kNormalScreen = "\033[?1049l";
constexpr const char* kCursorHidden = "\033[?25l";
constexpr const char* kCursorShown = "\033[?25h";

// Far beyond what anything here takes; a test that fails is not to hold up the others for long.
constexpr std::chrono::seconds kLongest(20);

class Live : public Cli {
 protected:
  Result marble(const std::string& arguments, const std::vector<std::string>& environment = {}) {
    return run(arguments + " --server " + quoted(address()), "/dev/null", environment);
  }
  [[nodiscard]] std::string address() const { return "unix:" + directory_.file("socket"); }
  void serve(std::vector<std::string> flags = {}) {
    server_.reset();
    flags.insert(flags.end(), {"--listen", address()});
    server_ = std::make_unique<ServerProcess>(MARBLE_SERVER_BINARY, flags);
  }
  std::string submit(const std::string& arguments, const std::vector<std::string>& environment = {}) {
    const Result result = marble("submit " + arguments, environment);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.out.substr(0, result.out.find('\n'));
  }
  // Takes a worker until it is cancelled.
  std::string submit_long(const std::vector<std::string>& environment = {}) {
    const std::string path = file("long.pb", long_request().problem().SerializeAsString());
    return submit(long_options() + " " + quoted(path), environment);
  }
  Json job(const std::string& id) { return marble("job --output json " + id).lines().at(0); }

  // TERM=screen: pyte knows all that such a terminal is sent.
  void watch(const std::string& arguments, int width = 100, int height = 30,
             const std::vector<std::string>& environment = {"TERM=screen"}) {
    program_.reset();
    terminal_ = std::make_unique<Terminal>(width, height);
    screen_ = std::make_unique<EmulatedScreen>(width, height);
    all_.clear();
    before_ = terminal_->settings();
    std::string command = "exec env LC_ALL=C.UTF-8";  // of a name that is set twice a shell may take either
    for (const std::string& variable : environment) command += " " + quoted(variable);
    const std::string tty = quoted(terminal_->path());
    command += " " + quoted(MARBLE_BINARY) + " watch " + arguments + " --server " + quoted(address()) + " <" +
               tty + " >" + tty + " 2>" + tty;
    program_ = std::make_unique<ChildProcess>(std::vector<std::string>{"/bin/sh", "-c", command},
                                              directory_.file("shell"));
  }
  // All that was written since the start.
  const std::string& output() {
    const std::string more = terminal_->shown();
    all_ += more;
    screen_->show(more);
    return all_;
  }
  const std::string& screen() {
    output();
    return screen_->text();
  }
  void type(const std::string& keys) { terminal_->type(keys); }
  // Both this and leave() read all the while: a program whose terminal is full would wait.
  bool comes(const std::string& pattern) {
    const std::regex expected(pattern);
    const bool came = eventually(
        [&] {
          std::this_thread::sleep_for(std::chrono::milliseconds(20));
          return std::regex_search(screen(), expected);
        },
        kLongest);
    if (!came) ADD_FAILURE() << pattern << " is not on the screen:\n" << screen();
    return came;
  }
  // The exit code, or minus the signal that it ended by.
  int ended() {
    const bool over = eventually([&] { return output(), !program_->running(); }, kLongest);
    if (!over) {
      ADD_FAILURE() << "it does not end:\n" << screen();
      program_->send(SIGKILL);
    }
    const int code = program_->wait();
    output();
    return code;
  }
  int leave(const std::string& keys) {
    type(keys);
    return ended();
  }
  void resize(int width, int height) {
    output();
    screen_->resize(width, height);
    terminal_->resize(width, height);
  }
  // The terminal is as it was: normal screen, cursor, echo, lines.
  void expect_restored() {
    const std::size_t left = all_.rfind(kNormalScreen), hidden = all_.rfind(kCursorHidden);
    ASSERT_NE(left, std::string::npos);
    ASSERT_NE(hidden, std::string::npos);
    EXPECT_EQ(all_.find(kAlternateScreen, left), std::string::npos);
    EXPECT_NE(all_.find(kCursorShown, hidden), std::string::npos) << "the cursor is shown";
    const termios now = terminal_->settings();
    EXPECT_EQ(now.c_lflag, before_.c_lflag);
    EXPECT_EQ(now.c_iflag, before_.c_iflag);
    EXPECT_EQ(now.c_oflag, before_.c_oflag);
  }

  std::unique_ptr<ServerProcess> server_;
  std::unique_ptr<Terminal> terminal_;
  std::unique_ptr<EmulatedScreen> screen_;
  std::unique_ptr<ChildProcess> program_;

 private:
  termios before_ = {};
  std::string all_;
};

TEST_F(Live, ShowsServerQueueAndARunningJobThatGoesOn) {
  serve({"--workers", "1"});
  const std::string running = submit_long();
  submit("--priority batch " + quoted(file("good.json", kGood)));
  watch("");
  ASSERT_TRUE(comes("1 of 1 busy"));
  EXPECT_TRUE(comes("batch 1"));
  EXPECT_TRUE(comes("queued 0"));
  EXPECT_TRUE(comes(running.substr(0, 8) + "[^\n]* running +[1-9]"));
  const std::regex iterations(" running +([0-9]+) ");
  const auto count = [&] {
    std::smatch found;
    const std::string text = screen();
    return std::regex_search(text, found, iterations) ? std::stol(found[1]) : -1L;
  };
  const long first = count();
  EXPECT_TRUE(eventually([&] { return count() > first; }, kLongest)) << screen();
  EXPECT_TRUE(comes("running[^\n]*(▁|▂|▃|▄|▅|▆|▇|█)")) << "a sparkline";
  EXPECT_EQ(leave("q"), 0);
  expect_restored();
}

TEST_F(Live, EnterOpensAJobAndCThenYCancelsIt) {
  serve({"--workers", "1"});
  const std::string running = submit_long();
  watch("");
  ASSERT_TRUE(comes(running.substr(0, 8)));
  type("\r");
  ASSERT_TRUE(comes("job " + running + "  running"));
  EXPECT_TRUE(comes("largest violation"));
  EXPECT_TRUE(comes("objective +equality"));
  type("c");
  ASSERT_TRUE(comes("cancel job " + running + "\\? y/n"));
  type("n");
  ASSERT_TRUE(comes("q back"));
  EXPECT_EQ(job(running)["state"], "running") << "no is no";
  type("c");
  ASSERT_TRUE(comes("y/n"));
  type("y");
  EXPECT_TRUE(comes("job " + running + "  cancelled"));
  EXPECT_TRUE(comes("of it factorizations")) << "timings split";
  EXPECT_EQ(job(running)["status"], "cancelled");
  type("\033");
  EXPECT_TRUE(comes("0 of 1 busy"));
  EXPECT_EQ(leave("q"), 0);
  expect_restored();
}

TEST_F(Live, OfOneJobTheExitCodeIsItsOwnAndALineStays) {
  serve();
  const std::string id = submit(quoted(file("no.json", kUnsolvable)));
  EXPECT_EQ(marble("result --wait " + id).exit_code, 1);
  watch(id);
  ASSERT_TRUE(comes("job " + id));
  ASSERT_TRUE(comes("infeasible"));
  EXPECT_EQ(leave("q"), 1);
  expect_restored();
  EXPECT_NE(output().find(id + " finished", output().rfind(kNormalScreen)), std::string::npos);
  watch("nothing");
  EXPECT_EQ(ended(), 2);
  EXPECT_NE(output().find("marble: job nothing"), std::string::npos);
}

TEST_F(Live, FollowsTheSizeOfTheTerminalDownToASmallOne) {
  serve({"--workers", "1"});
  submit_long();
  watch("");
  ASSERT_TRUE(comes("iter +time"));
  resize(40, 12);
  ASSERT_TRUE(comes("^marble [^\n]*\nworkers [^\n]*\njob [^\n]*\n[^\n]* running ")) << "line by line";
  EXPECT_TRUE(comes("\n\nq quit [^\n]*$")) << "nothing wraps";
  type("\r");
  ASSERT_TRUE(comes("iteration"));
  resize(120, 40);
  EXPECT_TRUE(comes("n/n_e/n_i/n_c"));
  EXPECT_TRUE(comes("residual +kappa"));
  EXPECT_EQ(leave("qq"), 0);
}

TEST_F(Live, SaysThatItIsDisconnectedAndRecoversWithTheServer) {
  serve();
  watch("");
  ASSERT_TRUE(comes("  connected"));
  server_->terminate();
  EXPECT_EQ(server_->wait(), 0);
  ASSERT_TRUE(comes("disconnected, retrying"));
  serve();
  ASSERT_TRUE(comes("  connected"));
  const std::string id = submit(quoted(file("good.json", kGood)));
  EXPECT_TRUE(comes(id.substr(0, 8) + "[^\n]*solved"));
  EXPECT_EQ(leave("q"), 0);
}

TEST_F(Live, SaysThatTheServerDrainsAndLeavesOneThatDoesNotAnswer) {
  serve({"--workers", "1"});
  submit_long();
  watch("", 80, 24);
  ASSERT_TRUE(comes("  connected"));
  server_->terminate();
  EXPECT_TRUE(comes("  draining"));
  server_->send(SIGSTOP);
  EXPECT_EQ(leave("q"), 0);
  expect_restored();
}

TEST_F(Live, WhoMayNotCancelIsReportedSoInWords) {
  const auto token = [&](const std::string& who) {
    ChildProcess maker({MARBLE_SERVER_BINARY, "--new-token", who}, directory_.file("made " + who));
    EXPECT_EQ(maker.wait(), 0);
    const std::string made = maker.output();
    const std::size_t first_end = made.find('\n');
    return std::pair(made.substr(0, first_end), made.substr(first_end + 1));
  };
  const auto [owner, owner_line] = token("owner:solve");
  const auto [viewer, viewer_line] = token("viewer:observe");
  serve({"--workers", "1", "--tokens", file("tokens", owner_line + viewer_line)});
  const std::string id = submit_long({"MARBLE_TOKEN=" + owner});
  watch("", 80, 24, {"TERM=screen", "MARBLE_TOKEN=" + viewer});
  ASSERT_TRUE(comes(id.substr(0, 8)));
  type("c");
  ASSERT_TRUE(comes("y/n"));
  type("y");
  EXPECT_TRUE(comes("is not cancelled: [\\s\\S]*admin"));
  EXPECT_EQ(leave("q"), 0);
}

TEST_F(Live, SignalsEndItWithTheTerminalAsItWas) {
  serve();
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    watch("");
    ASSERT_TRUE(comes("  connected"));
    program_->send(signal);
    EXPECT_EQ(ended(), signal == SIGINT ? 0 : -signal);
    expect_restored();
  }
}

TEST_F(Live, GivesTheTerminalBackWhileItIsStopped) {
  serve();
  watch("");
  ASSERT_TRUE(comes("  connected"));
  program_->send(SIGTSTP);
  ASSERT_TRUE(eventually([&] { return output().find(kNormalScreen) != std::string::npos; }, kLongest));
  program_->send(SIGCONT);
  const auto taken_again = [&] { return output().rfind(kAlternateScreen) > output().rfind(kNormalScreen); };
  ASSERT_TRUE(eventually(taken_again, kLongest));
  EXPECT_TRUE(comes("connected"));
  EXPECT_EQ(leave("q"), 0);
  expect_restored();
}

TEST_F(Live, ColoursAreThereUnlessTheyAreNotWanted) {
  serve();
  const std::regex colour("\033\\[[0-9;]*3[0-7]m");
  for (const bool wanted : {true, false}) {
    watch("", 100, 30, {"TERM=screen", wanted ? "NO_COLOR=" : "NO_COLOR=1"});
    ASSERT_TRUE(comes("  connected"));
    EXPECT_EQ(std::regex_search(output(), colour), wanted);
    EXPECT_EQ(leave("q"), 0);
  }
}

TEST_F(Live, PlainLinesWhereTheyAreAskedForOrTheTerminalCanDoNoMore) {
  serve();
  const std::string id = submit(quoted(file("good.json", kGood)));
  ASSERT_EQ(marble("result --wait " + id).exit_code, 0);
  const auto plain = [&](const std::string& flags, const std::vector<std::string>& environment) {
    watch(flags + id, 100, 30, environment);
    EXPECT_EQ(ended(), 0);
    const std::string& text = output();
    EXPECT_EQ(text.find('\033'), std::string::npos) << text;
    EXPECT_NE(text.find(id + " finished  good  solved"), std::string::npos) << text;
  };
  plain("--plain ", {"TERM=screen"});
  plain("", {"TERM=dumb"});
  plain("", {"TERM=no-such-terminal"});
}

}  // namespace
}  // namespace marble::testing
