#include "cli_test.h"

namespace marble::testing {
namespace {

// The command line and a server: addresses, the same output as in process, and refusals.
TEST_F(Cli, AnUnreachableServerExitsThree) {
  const Result result = run("solve --quiet --server 127.0.0.1:1 " + quoted(file("good.json", kGood)));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("127.0.0.1:1"), std::string::npos) << result.err;
  EXPECT_EQ(run("health --server 127.0.0.1:1").exit_code, 3);
  EXPECT_EQ(run("info", "/dev/null", {"MARBLE_SERVER=unix:/nonexistent"}).exit_code, 3);
}

TEST_F(Cli, TalksToAServerOverTcpAndUnixSocketAndByEnvironment) {
  const std::string socket = "unix:" + directory_.file("socket");
  ServerProcess server(MARBLE_SERVER_BINARY, {"--listen", "127.0.0.1:0", "--listen", socket});
  const std::string good = quoted(file("good.json", kGood));
  for (const std::string& address : {server.address(), socket}) {
    const Result result = run("solve --server '" + address + "' " + good);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(result.out.find("in the queue"), std::string::npos) << result.out;
    EXPECT_NE(result.err.find("kappa"), std::string::npos) << "the same table as a local solve";
  }
  EXPECT_EQ(run("solve --quiet " + good, "/dev/null", {"MARBLE_SERVER=" + server.address()}).exit_code, 0);
  const Result info = run("info --output json --server " + server.address());
  EXPECT_EQ(info.exit_code, 0);
  EXPECT_EQ(info.lines().at(0)["solved"], 3);
}

// Without the lines that say what a solve is doing where a busy machine keeps it from an iteration for long.
std::string table_of(const std::string& err) {
  std::istringstream lines(err);
  std::string table;
  for (std::string line; std::getline(lines, line);) {
    const bool is_activity = line.starts_with("  ") && line.size() > 2 && std::isalpha(line[2]) != 0;
    if (!is_activity) table += line + "\n";
  }
  return table;
}

TEST_F(Cli, RemoteTableHasEveryIteration) {
  ServerProcess server(MARBLE_SERVER_BINARY);
  const std::string rocket = quoted(file("rocket.json", run("example rocket").out));
  const Result local = run("solve --local " + rocket);
  const Result remote = run("solve --server " + server.address() + " " + rocket);
  EXPECT_EQ(table_of(local.err), table_of(remote.err));
}

// Everything but times and the job's id.
Json lasting(Json line) {
  for (const char* key : {"solve_seconds", "setup_seconds", "factorization_seconds", "line_search_seconds",
                          "polish_seconds", "tree_seconds", "queue_seconds", "job_id"})
    line.erase(key);
  return line;
}

TEST_F(Cli, JsonLinesAreTheSameFromHereAndFromAServer) {
  ServerProcess server(MARBLE_SERVER_BINARY);
  std::string files;
  for (const std::string example : {"hopper --steps 12", "rocket --steps 20", "gates --steps 10"})
    files += quoted(file(example + ".json", run("example " + example).out)) + " ";
  files += quoted(file("no.json", kUnsolvable)) + " " + quoted(file("bad.json", "{")) + " " +
           quoted(file("good.json", kGood));
  const Result local = run("solve --quiet --output json --local " + files);
  const Result remote = run("solve --quiet --output json --server " + server.address() + " " + files);
  EXPECT_EQ(local.exit_code, 2);
  EXPECT_EQ(remote.exit_code, local.exit_code);
  const auto here = local.lines();
  const auto there = remote.lines();
  ASSERT_EQ(here.size(), 6U);
  ASSERT_EQ(there.size(), here.size());
  for (std::size_t i = 0; i < here.size(); ++i) EXPECT_EQ(lasting(here[i]), lasting(there[i])) << i;
}

TEST_F(Cli, ARefusalExitsThreeAndKeepsOneLineAFile) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--message-bytes", "20000"});
  const std::string large = quoted(file("large.json", run("example rocket").out));
  const std::string good = quoted(file("good.json", kGood));
  const Result result =
      run("solve --output json --server " + server.address() + " " + large + " " + good + " " + large);
  EXPECT_EQ(result.exit_code, 3);
  const auto lines = result.lines();
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0]["error"]["code"], "resource_exhausted") << lines[0];
  EXPECT_EQ(lines[1]["status"], "solved");
  EXPECT_EQ(lines[2]["file"], directory_.file("large.json"));
}

TEST_F(Cli, AnAddressThatIsNoneExitsTwo) {
  const std::string good = quoted(file("good.json", kGood));
  for (const std::string address : {"localhost", "localhost:", "localhost:99999", ":50051", "unix:"}) {
    const Result result = run("solve --quiet --server " + address + " " + good);
    EXPECT_EQ(result.exit_code, 2) << address;
    EXPECT_NE(result.err.find("address = \"" + address + "\": must"), std::string::npos) << result.err;
  }
  EXPECT_EQ(run("info", "/dev/null", {"MARBLE_SERVER=nowhere"}).exit_code, 2);
  EXPECT_EQ(run("solve --local --server 127.0.0.1:1 " + good).exit_code, 2);
}

TEST_F(Cli, AFileNameOfAnyBytesIsSolvedAndReported) {
  ServerProcess server(MARBLE_SERVER_BINARY);
  const std::string odd = quoted(file("\xff\xfe odd \xc3\xa4.json", kGood));
  const std::string longer = quoted(file(std::string(250, 'n'), kGood));
  const Result result = run("solve --output json --server " + server.address() + " " + odd + " " + longer);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.lines().size(), 2U);
}

// One list of addresses for the program, as an option or in the environment.
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
