// One list of addresses for the program, as an option or in the environment.
#include "cli_test.h"

namespace marble::testing {
namespace {

class SeveralServers : public Cli {
 protected:
  ServerProcess first_{MARBLE_SERVER_BINARY}, second_{MARBLE_SERVER_BINARY};
  const std::string both_ = first_.address() + "," + second_.address();
  const std::string good_ = quoted(file("good.json", kGood));
};

TEST_F(SeveralServers, AreGivenWithCommasBetween) {
  const Result solved = run("solve " + good_ + " --server " + both_);
  EXPECT_EQ(solved.exit_code, 0) << solved.err;
  const Result batch = run("batch " + good_ + " " + good_, "/dev/null", {"MARBLE_SERVER=" + both_});
  EXPECT_EQ(batch.exit_code, 0) << batch.err;
  EXPECT_EQ(run("health", "/dev/null", {"MARBLE_SERVER=" + both_}).exit_code, 0);
}

TEST_F(SeveralServers, OneThatIsGoneIsNotMissed) {
  first_.send(SIGKILL);
  for (int i = 0; i < 4; ++i) {
    const Result solved = run("solve " + good_, "/dev/null", {"MARBLE_SERVER=" + both_});
    EXPECT_EQ(solved.exit_code, 0) << solved.err;
  }
}

TEST_F(SeveralServers, AClosedLoopGoesOnElsewhereAndSaysSo) {
  const Run mpc = start("mpc hopper --steps 12 --control-steps 1000 --output json --server " + both_);
  ASSERT_TRUE(eventually([&] { return read_file(mpc.out).find("\"step\":20,") != std::string::npos; }));
  mpc.process->send(SIGSTOP);  // or it might be through before its server is found
  const Result at_first = run("info --output json --server " + first_.address());
  (at_first.lines().at(0)["sessions"] == 1 ? first_ : second_).send(SIGKILL);
  mpc.process->send(SIGCONT);
  const Result result = mpc.wait();
  EXPECT_NE(result.exit_code, 3) << result.err;
  EXPECT_NE(result.err.find("the server was lost; the session was set up again"), std::string::npos)
      << result.err;
  const auto lines = result.lines();
  ASSERT_EQ(lines.size(), 1002U) << "the first plan, all control steps, a summary";
  EXPECT_EQ(std::count_if(lines.begin(), lines.end() - 1, [](const Json& line) { return line["reopened"]; }),
            1);
}

TEST_F(SeveralServers, AnyOfThemListsJobs) {
  const Result jobs = run("jobs --server " + both_);
  EXPECT_EQ(jobs.exit_code, 0) << jobs.err;
}

}  // namespace
}  // namespace marble::testing
