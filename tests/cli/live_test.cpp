// `marble watch` at a terminal: the real program on a real terminal, looked at as a person would.
#include <sys/stat.h>

#include <regex>

#include "cli_test.h"
#include "long_options.h"
#include "problems.h"
#include "terminal.h"

namespace marble::testing {
namespace {

constexpr const char* kAlternateScreen = "\033[?1049h";
constexpr const char* kNormalScreen = "\033[?1049l";
constexpr const char* kCursorShown = "\033[?25h";

class Live : public Cli {
 protected:
  Result marble(const std::string& arguments) { return run(arguments + " --server " + address()); }
  [[nodiscard]] std::string address() const { return "unix:" + directory_.file("socket"); }
  void serve(std::vector<std::string> flags = {}) {
    server_.reset();
    flags.insert(flags.end(), {"--listen", address()});
    server_ = std::make_unique<ServerProcess>(MARBLE_SERVER_BINARY, flags);
  }
  std::string submit(const std::string& arguments) {
    const std::string out = marble("submit " + arguments).out;
    return out.substr(0, out.find('\n'));
  }
  // Takes a worker until it is cancelled.
  std::string submit_long() {
    const std::string path = file("long.pb", long_request().problem().SerializeAsString());
    return submit(long_options() + " " + quoted(path));
  }

  void watch(const std::string& arguments, int width = 100, int height = 30,
             std::vector<std::string> environment = {}) {
    terminal_ = std::make_unique<Terminal>(width, height);
    before_ = terminal_->settings();
    environment.insert(environment.begin(), {"TERM=xterm", "LC_ALL=C.UTF-8"});
    std::string command = "exec env";  // of a name that is set twice a shell may take either
    for (const std::string& variable : environment) command += " '" + variable + "'";
    const std::string tty = "'" + terminal_->path() + "'";
    command += std::string(" '") + MARBLE_BINARY + "' watch " + arguments + " --server '" + address() +
               "' <" + tty + " >" + tty + " 2>" + tty;
    program_ = std::make_unique<ChildProcess>(std::vector<std::string>{"/bin/sh", "-c", command},
                                              directory_.file("shell"));
  }
  // All bytes since the start.
  const std::string& bytes() {
    bytes_ += terminal_->shown();
    return bytes_;
  }
  std::string screen() {
    const std::string raw = file("bytes", bytes());
    const std::string text = directory_.file("screen");
    std::filesystem::remove(text);
    ChildProcess emulator({SCREEN_OF, raw, std::to_string(first_width_()), std::to_string(first_height_())},
                          text);
    EXPECT_EQ(emulator.wait(), 0) << read_file(text);
    return read_file(text);
  }
  bool comes(const std::string& pattern) {
    const std::regex expected(pattern);
    const bool came = eventually([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      return std::regex_search(screen(), expected);
    });
    if (!came) ADD_FAILURE() << pattern << " is not on the screen:\n" << screen();
    return came;
  }
  void resize(int width, int height) {
    bytes();
    bytes_ += "\033]size;" + std::to_string(width) + ";" + std::to_string(height) + "\a";
    if (width0_ == 0) width0_ = terminal_->width(), height0_ = terminal_->height();
    terminal_->resize(width, height);
  }
  // The terminal is as it was: normal screen, cursor, echo, lines.
  void expect_restored() {
    const std::string& all = bytes();
    const std::size_t left = all.rfind(kNormalScreen);
    ASSERT_NE(left, std::string::npos);
    EXPECT_EQ(all.find(kAlternateScreen, left), std::string::npos);
    EXPECT_GT(all.rfind(kCursorShown) + 1, all.find("\033[?25l") + 1) << "the cursor is shown";
    const termios now = terminal_->settings();
    EXPECT_EQ(now.c_lflag, before_.c_lflag);
    EXPECT_EQ(now.c_iflag, before_.c_iflag);
    EXPECT_EQ(now.c_oflag, before_.c_oflag);
  }

  std::unique_ptr<ServerProcess> server_;
  std::unique_ptr<Terminal> terminal_;
  std::unique_ptr<ChildProcess> program_;

 private:
  [[nodiscard]] int first_width_() const { return width0_ > 0 ? width0_ : terminal_->width(); }
  [[nodiscard]] int first_height_() const { return height0_ > 0 ? height0_ : terminal_->height(); }

  termios before_ = {};
  std::string bytes_;
  int width0_ = 0, height0_ = 0;
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
  EXPECT_TRUE(eventually([&] { return count() > first; })) << screen();
  EXPECT_TRUE(comes("running[^\n]*[▁▂▃▄▅▆▇█]")) << "a sparkline";
  terminal_->type("q");
  EXPECT_EQ(program_->wait(), 0);
  expect_restored();
}

TEST_F(Live, EnterOpensAJobAndCThenYCancelsIt) {
  serve({"--workers", "1"});
  const std::string running = submit_long();
  watch("");
  ASSERT_TRUE(comes(running.substr(0, 8)));
  terminal_->type("\r");
  ASSERT_TRUE(comes("job " + running + "  running"));
  EXPECT_TRUE(comes("largest violation"));
  EXPECT_TRUE(comes("objective +equality"));
  terminal_->type("c");
  ASSERT_TRUE(comes("cancel job " + running + "\\? y/n"));
  terminal_->type("n");
  ASSERT_TRUE(comes("q back"));
  EXPECT_EQ(marble("job --output json " + running).lines().at(0)["state"], "running") << "no is no";
  terminal_->type("c");
  ASSERT_TRUE(comes("y/n"));
  terminal_->type("y");
  EXPECT_TRUE(comes("job " + running + "  cancelled"));
  EXPECT_TRUE(comes("of it factorizations")) << "timings split";
  EXPECT_EQ(marble("job --output json " + running).lines().at(0)["status"], "cancelled");
  terminal_->type("\033");
  EXPECT_TRUE(comes("0 of 1 busy"));
  terminal_->type("q");
  EXPECT_EQ(program_->wait(), 0);
  expect_restored();
}

TEST_F(Live, OfOneJobTheExitCodeIsItsOwnAndALineStays) {
  serve();
  const std::string id = submit(quoted(file("no.json", kUnsolvable)));
  EXPECT_EQ(marble("result --wait " + id).exit_code, 1);
  watch(id);
  ASSERT_TRUE(comes("job " + id));
  ASSERT_TRUE(comes("infeasible"));
  terminal_->type("q");
  EXPECT_EQ(program_->wait(), 1);
  expect_restored();
  const std::string& all = bytes();
  EXPECT_NE(all.find(id + " finished", all.rfind(kNormalScreen)), std::string::npos);
  watch("nothing");
  EXPECT_EQ(program_->wait(), 2);
  EXPECT_NE(terminal_->shown().find("marble: job nothing"), std::string::npos);
}

TEST_F(Live, FollowsTheSizeOfTheTerminalDownToASmallOne) {
  serve({"--workers", "1"});
  submit_long();
  watch("");
  ASSERT_TRUE(comes("iter +time"));
  resize(40, 12);
  ASSERT_TRUE(comes("running"));
  std::istringstream lines(screen());
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) EXPECT_LE(line.size(), 40U * 3) << line;
  EXPECT_EQ(count, 12);
  terminal_->type("\r");
  ASSERT_TRUE(comes("iteration"));
  resize(120, 40);
  EXPECT_TRUE(comes("n/n_e/n_i/n_c"));
  EXPECT_TRUE(comes("residual +kappa"));
  terminal_->type("qq");
  EXPECT_EQ(program_->wait(), 0);
}

TEST_F(Live, SaysThatItIsDisconnectedAndRecoversWithTheServer) {
  serve();
  watch("");
  ASSERT_TRUE(comes("connected"));
  server_->terminate();
  EXPECT_EQ(server_->wait(), 0);
  ASSERT_TRUE(comes("disconnected, retrying"));
  serve();
  ASSERT_TRUE(comes("  connected"));
  const std::string id = submit(quoted(file("good.json", kGood)));
  EXPECT_TRUE(comes(id.substr(0, 8) + "[^\n]*solved"));
  terminal_->type("q");
  EXPECT_EQ(program_->wait(), 0);
}

TEST_F(Live, WhoMayNotCancelIsToldSoInWords) {
  serve({"--workers", "1", "--tokens", file("tokens", "")});
  server_.reset();
  const std::string binary = MARBLE_SERVER_BINARY;
  const auto made = [&](const std::string& who) {
    ChildProcess maker({binary, "--new-token", who}, directory_.file("made " + who));
    EXPECT_EQ(maker.wait(), 0);
    std::istringstream text(maker.output());
    std::string token, line;
    std::getline(text, token);
    while (line.empty() || line == token) {
      if (!std::getline(text, line)) break;
    }
    return std::pair(token, line);
  };
  const auto [owner, owner_line] = made("owner:solve");
  const auto [viewer, viewer_line] = made("viewer:observe");
  serve({"--workers", "1", "--tokens", file("tokens", owner_line + "\n" + viewer_line + "\n")});
  const std::string path = file("long.pb", long_request().problem().SerializeAsString());
  const std::string out = run("submit --server " + address() + long_options() + " " + quoted(path),
                              "/dev/null", {"MARBLE_TOKEN=" + owner})
                              .out;
  const std::string id = out.substr(0, out.find('\n'));
  ASSERT_FALSE(id.empty());
  watch("", 120, 30, {"MARBLE_TOKEN=" + viewer});
  ASSERT_TRUE(comes(id.substr(0, 8)));
  terminal_->type("c");
  ASSERT_TRUE(comes("y/n"));
  terminal_->type("y");
  EXPECT_TRUE(comes("is not cancelled: .*admin"));
}

TEST_F(Live, SignalsEndItWithTheTerminalAsItWas) {
  serve();
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    watch("");
    ASSERT_TRUE(comes("connected"));
    program_->send(signal);
    EXPECT_EQ(program_->wait(), signal == SIGINT ? 0 : -signal);
    expect_restored();
  }
}

TEST_F(Live, GivesTheTerminalBackWhileItIsStopped) {
  serve();
  watch("");
  ASSERT_TRUE(comes("connected"));
  program_->send(SIGTSTP);
  ASSERT_TRUE(eventually([&] { return bytes().find(kNormalScreen) != std::string::npos; }));
  program_->send(SIGCONT);
  ASSERT_TRUE(eventually([&] { return bytes().rfind(kAlternateScreen) > bytes().rfind(kNormalScreen); }));
  EXPECT_TRUE(comes("connected"));
  terminal_->type("q");
  EXPECT_EQ(program_->wait(), 0);
  expect_restored();
}

TEST_F(Live, ColoursAreThereUnlessTheyAreNotWanted) {
  serve();
  const std::regex colour("\033\\[[0-9;]*3[0-7]m");
  for (const bool wanted : {true, false}) {
    watch("", 100, 30, {wanted ? "NO_COLOR=" : "NO_COLOR=1"});
    const std::size_t start = bytes().size();
    ASSERT_TRUE(comes("connected"));
    EXPECT_EQ(std::regex_search(bytes().substr(start), colour), wanted);
    terminal_->type("q");
    EXPECT_EQ(program_->wait(), 0);
    static_cast<void>(bytes());
  }
}

TEST_F(Live, PlainLinesWhereTheyAreAskedForOrTheTerminalCanDoNoMore) {
  serve();
  const std::string id = submit(quoted(file("good.json", kGood)));
  ASSERT_EQ(marble("result --wait " + id).exit_code, 0);
  const auto plain = [&](const std::string& flags, std::vector<std::string> environment) {
    watch(flags + id, 100, 30, std::move(environment));
    EXPECT_EQ(program_->wait(), 0);
    const std::string text = terminal_->shown();
    EXPECT_EQ(text.find('\033'), std::string::npos) << text;
    EXPECT_NE(text.find(id + " finished  good  solved"), std::string::npos) << text;
  };
  plain("--plain ", {});
  plain("", {"TERM=dumb"});
  plain("", {"TERM=no-such-terminal"});
}

}  // namespace
}  // namespace marble::testing
