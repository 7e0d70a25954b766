// batch and mpc; and how a command says who it is.
#include "cli_test.h"
#include "long_options.h"

namespace marble::testing {
namespace {

class LoopCommands : public Cli {
 protected:
  Result marble(const std::string& arguments) { return run(arguments + " --server " + server_.address()); }

  ServerProcess server_{MARBLE_SERVER_BINARY};
};

TEST_F(LoopCommands, BatchAnswersEveryFileOnce) {
  std::string files;
  for (int i = 0; i < 100; ++i) files += quoted(file("good " + std::to_string(i) + ".json", kGood)) + " ";
  files += quoted(file("no.json", kUnsolvable)) + " " + quoted(file("bad.json", "{"));
  const Result text = marble("batch " + files);
  EXPECT_EQ(text.exit_code, 2) << "the worst";
  EXPECT_NE(text.out.find("good 99.json: solved  objective 0.5"), std::string::npos) << text.out;
  EXPECT_EQ(std::count(text.out.begin(), text.out.end(), '\n'), 101);
  EXPECT_NE(text.err.find("bad.json: "), std::string::npos);
  const Result json = marble("batch --output json " + files);
  EXPECT_EQ(json.exit_code, 2);
  std::map<std::string, int> seen;
  for (const Json& line : json.lines()) ++seen[line["file"]];
  EXPECT_EQ(seen.size(), 102U);
  for (const auto& [path, count] : seen) EXPECT_EQ(count, 1) << path;
}

TEST_F(LoopCommands, BatchWithoutAServerReportsEveryFile) {
  const std::string good = quoted(file("good.json", kGood));
  const Result result =
      run("batch --output json --server 127.0.0.1:1 " + good + " " + good + " " + good + " " + good);
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("127.0.0.1:1"), std::string::npos) << result.err;
  ASSERT_EQ(result.lines().size(), 4U);
  for (const Json& line : result.lines()) EXPECT_EQ(line["error"]["code"], "unavailable");
}

TEST_F(LoopCommands, CtrlCEndsABatchAndEveryFileHasItsLine) {
  const std::string path = quoted(file("long.pb", long_request().problem().SerializeAsString()));
  const Run batch = start("batch --output json" + long_options() + " " + path + " " + path + " " + path +
                          " --server " + server_.address());
  ASSERT_TRUE(eventually([&] { return marble("info --output json").lines().at(0)["running"] != 0; }));
  batch.process->send(SIGINT);
  const Result result = batch.wait();
  EXPECT_EQ(result.exit_code, 1) << result.err;
  ASSERT_EQ(result.lines().size(), 3U);
  for (const Json& line : result.lines()) EXPECT_EQ(line["error"]["code"], "cancelled");
}

TEST_F(LoopCommands, MpcInThisProcessIsTheSameLoopAsOverAServer) {
  const std::string loop = "mpc hopper --steps 20 --control-steps 3 --seed 4 --output json";
  const auto there = marble(loop).lines();
  const Result local = run(loop + " --local");
  ASSERT_EQ(local.exit_code, 0) << local.err;
  const auto here = local.lines();
  ASSERT_EQ(here.size(), 5U);
  ASSERT_EQ(there.size(), here.size());
  for (std::size_t i = 0; i < 4; ++i) {
    for (const char* key : {"step", "status", "objective", "iterations", "factorizations"})
      EXPECT_EQ(here[i][key], there[i][key]) << key << " of step " << i;
  }
  EXPECT_EQ(run(loop + " --local --server 127.0.0.1:1").exit_code, 2);
}

TEST_F(LoopCommands, MpcInTwoPartsIsTheSameLoop) {
  const std::string loop = "mpc hopper --steps 20 --control-steps 3 --seed 4 --output json";
  const auto whole = marble(loop).lines(), parts = marble(loop + " --prepare").lines(),
             here = run(loop + " --prepare --local").lines();
  ASSERT_EQ(whole.size(), 5U);
  ASSERT_EQ(parts.size(), 5U);
  ASSERT_EQ(here.size(), 5U);
  for (std::size_t i = 0; i < 4; ++i) {
    for (const char* key : {"step", "status", "objective", "iterations", "factorizations"}) {
      EXPECT_EQ(parts[i][key], whole[i][key]) << key << " of step " << i;
      EXPECT_EQ(here[i][key], whole[i][key]) << key << " of step " << i;
    }
  }
}

TEST_F(LoopCommands, MpcIsCheaperWarmThanCold) {
  const Result warm = marble("mpc hopper --control-steps 4 --output json");
  ASSERT_EQ(warm.exit_code, 0) << warm.err;
  const auto lines = warm.lines();
  ASSERT_EQ(lines.size(), 6U) << "the first plan, four control steps, a summary";
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(lines[i]["step"], i);
    EXPECT_GE(lines[i]["round_trip_ms"], lines[i]["solve_ms"]);
  }
  const Result cold = marble("mpc hopper --control-steps 4 --cold --output json");
  ASSERT_EQ(cold.exit_code, 0) << cold.err;
  EXPECT_EQ(cold.lines().back()["summary"], "cold");
  EXPECT_LT(lines.back()["median_factorizations"], cold.lines().back()["median_factorizations"]);
  const Result text = marble("mpc hopper --steps 12 --control-steps 2");
  EXPECT_NE(text.out.find("round trip ms"), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("median of 2 warm control steps: "), std::string::npos) << text.out;
  EXPECT_EQ(run("mpc hopper --server 127.0.0.1:1").exit_code, 3);
  EXPECT_EQ(marble("mpc unicycle").exit_code, 2);
}

TEST_F(LoopCommands, CtrlCEndsMpc) {
  const Run mpc = start("mpc hopper --control-steps 100000 --server " + server_.address());
  ASSERT_TRUE(eventually([&] { return read_file(mpc.out).find("\n    1 ") != std::string::npos; }));
  mpc.process->send(SIGINT);
  const Result result = mpc.wait();
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_NE(result.out.find("median of"), std::string::npos) << result.out;
  EXPECT_TRUE(eventually([&] { return marble("info --output json").lines().at(0)["sessions"] == 0; }));
}

TEST_F(LoopCommands, MpcFollowsItsLastPlanWhileTheServerHangs) {
  const Run mpc =
      start("mpc hopper --steps 4 --control-steps 100000 --deadline 0.05 --output json --server " +
            server_.address());
  const auto has = [&](const std::string& text, std::size_t after) {
    return read_file(mpc.out).find(text, after) != std::string::npos;
  };
  ASSERT_TRUE(eventually([&] { return has("\"step\":20,", 0); }));
  server_.send(SIGSTOP);
  EXPECT_TRUE(eventually([&] { return has("the server did not answer within 0.15 s", 0); }));
  server_.send(SIGCONT);
  const std::size_t missed = read_file(mpc.out).size();
  EXPECT_TRUE(eventually([&] { return has("\"status\":\"solved\"", missed); }));
  mpc.process->send(SIGINT);
  EXPECT_EQ(mpc.wait().exit_code, 1);
  EXPECT_EQ(marble("mpc hopper --deadline 0").exit_code, 2);
}

TEST_F(LoopCommands, InfoReportsLimitsAndCountersOfSessions) {
  ASSERT_EQ(marble("mpc hopper --steps 4 --control-steps 2").exit_code, 0);
  const Json info = marble("info --output json").lines().at(0);
  EXPECT_EQ(info["sessions_opened"], 1);
  EXPECT_EQ(info["updates"], 3);
  EXPECT_EQ(info["batch_window"], 64);
  EXPECT_NE(marble("info").out.find("result_keep_s        3600"), std::string::npos) << marble("info").out;
}

TEST_F(LoopCommands, CredentialsThatCannotBeReadExitTwo) {
  const Result ca = marble("info --tls-ca /nonexistent/ca.pem");
  EXPECT_EQ(ca.exit_code, 2);
  EXPECT_NE(ca.err.find("tls_ca = /nonexistent/ca.pem: cannot be read"), std::string::npos) << ca.err;
  const std::string good = quoted(file("good.json", kGood));
  EXPECT_EQ(run("solve " + good, "/dev/null", {"MARBLE_TLS_CA=/nonexistent/ca.pem"}).exit_code, 2);
  const Result token = marble("jobs --token-file /nonexistent/token");
  EXPECT_EQ(token.exit_code, 2);
  EXPECT_NE(token.err.find("--token-file = /nonexistent/token: cannot be read"), std::string::npos)
      << token.err;
  EXPECT_EQ(marble("jobs --token-file " + quoted(file("token", "s3cret\nand more\n"))).exit_code, 0);
  const Result bad = marble("jobs --token-file " + quoted(file("token", "two words\n")));
  EXPECT_EQ(bad.exit_code, 2);
  EXPECT_EQ(bad.err.find("two words"), std::string::npos) << "a secret is not shown";
  EXPECT_EQ(marble("health --client-name " + std::string(65, 'x')).exit_code, 2);
  EXPECT_EQ(marble("health --client-name robot").exit_code, 0);
  EXPECT_EQ(marble("solve --priority urgent " + good).exit_code, 2);
  EXPECT_EQ(marble("solve --quiet --priority batch " + good).exit_code, 0);
}

TEST_F(Cli, AServerWithoutTlsIsUnreachableWithIt) {
  ServerProcess server(MARBLE_SERVER_BINARY);
  EXPECT_EQ(run("health --tls --server " + server.address()).exit_code, 3);
}

}  // namespace
}  // namespace marble::testing
