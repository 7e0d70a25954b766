// Proofs on the command line (option global_search): what is reported of them, drawn, and ended.
#include <csignal>

#include "cli_test.h"

namespace marble::testing {
namespace {

constexpr const char* kGlobal = " --option global_search=true ";

class Proving : public Cli {
 protected:
  // No tree of it comes to an end in the time of a test.
  std::string endless() { return quoted(file("qpec.json", run("example qpec").out)); }
  Json info(const ServerProcess& server) {
    return run("info --output json --server " + server.address()).lines().at(0);
  }
  bool comes_to_run(const ServerProcess& server, int jobs) {
    return eventually([&] { return info(server)["running"] == jobs; });
  }
};

TEST_F(Proving, IsReportedInWordsAndInJson) {
  const std::string good = quoted(file("good.json", kGood));
  const Result words = run("solve --local --quiet" + std::string(kGlobal) + good);
  EXPECT_EQ(words.exit_code, 0) << words.err;
  EXPECT_NE(words.out.find("\n  proof           proved optimal: gap "), std::string::npos) << words.out;
  const Json proved = run("solve --local --quiet --output json" + std::string(kGlobal) + good).lines().at(0);
  EXPECT_EQ(proved["proved"], true);
  EXPECT_LE(proved["bound"].get<double>(), 0.5);
  EXPECT_GE(proved["nodes"], 1);
  EXPECT_EQ(proved["open_nodes"], 0);
  const Json local =
      run("solve --local --quiet --output json --option max_small_problem_nodes=0 " + good).lines().at(0);
  EXPECT_EQ(local["proved"], false);
  EXPECT_TRUE(local["bound"].is_null() && local["gap"].is_null()) << "JSON has no infinity";
  EXPECT_EQ(local["nodes"], 0);
}

TEST_F(Proving, TheKindOfAnswerIsReportedWithWhatToTry) {
  const std::string good = quoted(file("good.json", kGood));
  const Result proved = run("solve --local --quiet " + good);
  EXPECT_NE(proved.out.find("\n  answer          proved optimal\n"), std::string::npos) << proved.out;
  EXPECT_NE(proved.out.find(" factorizations, 1 node\n"), std::string::npos) << proved.out;
  EXPECT_EQ(proved.out.find("what to try"), std::string::npos) << proved.out;
  EXPECT_EQ(proved.out.find("  proof  "), std::string::npos) << "no option global_search: " << proved.out;
  const Json json = run("solve --local --quiet --output json " + good).lines().at(0);
  EXPECT_EQ(json["kind"], "proved_optimal");
  EXPECT_EQ(json["nodes"], 1);
  const std::string local = " --local --quiet --option max_small_problem_nodes=0 ";
  const Result words = run("solve" + local + good);
  EXPECT_NE(words.out.find("\n  answer          local minimum; no bound is known\n"), std::string::npos)
      << words.out;
  EXPECT_NE(words.out.find("\n  what to try     num_starts=8 searches 8 times, for about 8 times the work"),
            std::string::npos)
      << words.out;
  EXPECT_EQ(run("solve --output json" + local + good).lines().at(0)["kind"], "local_minimum");
}

TEST_F(Proving, AnOptionThatChangesNothingIsWarnedOf) {
  const std::string good = quoted(file("good.json", kGood));
  const Result idle = run("solve --local --quiet --option inner_tolerance=1e-3 " + good);
  EXPECT_EQ(idle.exit_code, 0);
  EXPECT_EQ(idle.err,
            "marble: warning: option inner_tolerance counts only with path = paper or algorithm1\n");
  const Result used = run("solve --local --quiet --option inner_tolerance=1e-3 --option path=paper " + good);
  EXPECT_EQ(used.err, "");
  EXPECT_EQ(run("solve --local --quiet --option kappa_min=1e-12 " + good).err, "");
}

TEST_F(Proving, HasATableOfItsOwnATraceAndAPicture) {
  const std::string csv = directory_.file("proof.csv");
  const Result result =
      run("solve --local --option node_limit=200 --trace " + quoted(csv) + kGlobal + endless());
  EXPECT_NE(result.err.find("complem."), std::string::npos) << "the local search comes first: " << result.err;
  EXPECT_NE(result.err.find(" nodes     open      incumbent          bound       gap  nodes/s"),
            std::string::npos)
      << result.err;
  const Result drawn = run("plot " + quoted(csv), "/dev/null", {"LC_ALL=C.UTF-8"});
  EXPECT_EQ(drawn.exit_code, 0) << drawn.err;
  for (const char* part : {"gap", "incumbent", "bound", "elapsed_s"})
    EXPECT_NE(drawn.out.find(part), std::string::npos) << part << '\n' << drawn.out;
  const Result of_path = run("plot --along iteration --columns kkt_residual " + quoted(csv));
  EXPECT_EQ(of_path.exit_code, 0) << of_path.err;
  EXPECT_EQ(of_path.out.find("incumbent"), std::string::npos) << of_path.out;
}

TEST_F(Proving, ASubmittedOneIsWatchedAndCancelledAndKeepsItsBound) {
  ServerProcess server(MARBLE_SERVER_BINARY);
  const std::string at = " --server " + server.address();
  std::string id = run("submit" + at + kGlobal + endless()).out;
  id.resize(id.find_last_not_of('\n') + 1);
  const Run watch = start("watch --plain " + id + at);
  EXPECT_TRUE(eventually([&] {
    return read_file(watch.out).find(", not proved yet: ") != std::string::npos;
  })) << read_file(watch.out);
  const Json shown = run("job --output json " + id + at).lines().at(0);
  EXPECT_GT(shown["nodes"], 0);
  EXPECT_GT(shown["trace"].back()["nodes"], 0);
  EXPECT_EQ(run("cancel " + id + at).exit_code, 0);
  const Result watched = watch.wait();
  EXPECT_EQ(watched.exit_code, 1);
  EXPECT_NE(watched.out.find(", not proved: "), std::string::npos) << watched.out;
  const Json answer = run("result --output json " + id + at).lines().at(0);
  EXPECT_EQ(answer["status"], "cancelled");
  EXPECT_GE(answer["nodes"], shown["nodes"]);
  EXPECT_EQ(answer["proved"], false);
  EXPECT_TRUE(answer["bound"].is_null() || answer["bound"] <= answer["objective"]);
}

TEST_F(Proving, AClientThatIsKilledFreesTheWorkers) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--workers", "2"});
  const Run solve = start("solve --quiet --server " + server.address() + kGlobal + endless());
  ASSERT_TRUE(comes_to_run(server, 1));
  solve.process->send(SIGKILL);
  EXPECT_TRUE(comes_to_run(server, 0));
}

}  // namespace
}  // namespace marble::testing
