// The command line and a server: addresses, the same output as in process, and refusals.
#include "cli_test.h"

namespace marble::testing {
namespace {

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

}  // namespace
}  // namespace marble::testing
