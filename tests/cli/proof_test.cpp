#include <csignal>

#include "cli_test.h"

namespace marble::testing {
namespace {

// Proofs on the command line (option global_search): what is reported of them, drawn, and ended.
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

// `marble explain`: conflicts by the names of the file, locally and on a server, and names that are no names.

// gap + force = 4, gap ≤ 1, force ≤ 2, and 0 ≤ slip ⊥ force ≥ 0, which has nothing to do with it.
Json arm() {
  return Json::parse(R"({"name":"arm","n":3,"g":[0,0,1],
      "A":{"rows":1,"cols":3,"i":[0,0],"j":[0,1],"v":[1,1]},"b":[-4],
      "C":{"rows":2,"cols":3,"i":[0,1],"j":[0,1],"v":[-1,-1]},"d":[1,2],
      "L":{"rows":1,"cols":3,"i":[0],"j":[2],"v":[1]},"l":[0],
      "R":{"rows":1,"cols":3,"i":[0],"j":[1],"v":[1]},"r":[0],
      "names":{"variables":["gap","force","slip"],"equalities":["balance"],
               "inequalities":["reach","strength"],"pairs":["touch"]}})");
}

class Explain : public Cli {
 protected:
  Result explained(const Json& problem, const std::string& options) {
    return run("explain --quiet " + options + " " + quoted(file("problem.json", problem.dump())));
  }
  // What is printed but for the time that it took.
  std::string parts_of(const std::string& command) {
    const std::string out = run(command).out;
    return out.substr(0, out.find("  time "));
  }
};

TEST_F(Explain, NamesEachPartAndByHowMuchToRelaxIt) {
  const Result result = explained(arm(), "--local");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  for (const char* part : {"balance", "gap + force = 4", "reach", "gap <= 1", "strength", "force <= 2",
                           "by 1", "minimal: without any one of its parts"})
    EXPECT_NE(result.out.find(part), std::string::npos) << part << " in " << result.out;
  EXPECT_EQ(result.out.find("touch"), std::string::npos) << result.out;
}

TEST_F(Explain, ReadsTheNamesOfStandardInputToo) {
  const std::string path = file("problem.json", arm().dump());
  const auto conflict = [&](const std::string& from, const std::string& input) {
    return run("explain --quiet --local --output json " + from, input).lines().at(0).at("conflict");
  };
  EXPECT_EQ(conflict("-", path), conflict(quoted(path), "/dev/null"));
}

TEST_F(Explain, FindsTheSameConflictOnAServer) {
  const ServerProcess server(MARBLE_SERVER_BINARY, {"--workers", "1"});
  const auto conflict = [&](const std::string& where) {
    const Result result = explained(arm(), "--output json " + where);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.lines().at(0).at("conflict");
  };
  const Json local = conflict("--local"), remote = conflict("--server " + server.address());
  EXPECT_EQ(local, remote);
  EXPECT_EQ(local["equalities"], Json::array({0}));
  EXPECT_EQ(local["inequalities"], Json::array({0, 1}));
  EXPECT_EQ(local["parts"][2]["name"], "strength");
}

TEST_F(Explain, AProblemWithAPointHasNoConflict) {
  Json problem = arm();
  problem["b"] = {-2};
  const Result result = explained(problem, "--local --output json");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_FALSE(result.lines().at(0).contains("conflict")) << result.out;
}

TEST_F(Explain, WithoutTimeItNamesNoConflictThatIsNotOne) {
  const Result result = explained(arm(), "--local --output json --time-limit 0");
  ASSERT_LE(result.exit_code, 1) << result.err;
  const Json answer = result.lines().at(0);
  EXPECT_TRUE(!answer.contains("conflict") || answer["conflict"]["minimal"] == false) << result.out;
}

TEST_F(Explain, RefusesNamesThatDoNotFitByTheirField) {
  const std::string deep = std::string(5000, '[') + std::string(5000, ']');
  const std::vector<std::pair<Json, std::string>> wrong = {
      {"gap", "names: must be an object"},
      {{{"variables", {"gap", "force"}}}, "names.variables: must be an array of 3 texts"},
      {{{"variables", "gap"}}, "names.variables: must be an array of 3 texts"},
      {{{"equalities", {1}}}, "names.equalities[0] = 1: must be a text"},
      {{{"pairs", {nullptr}}}, "names.pairs[0] = null: must be a text"}};
  for (const auto& [names, error] : wrong) {
    Json problem = arm();
    problem["names"] = names;
    const Result result = explained(problem, "--local");
    EXPECT_EQ(result.exit_code, 2) << names;
    EXPECT_NE(result.err.find(error), std::string::npos) << error << ": " << result.err;
  }
  const std::string text = R"({"n":1,"g":[1],"names":{"variables":)" + deep + "}}";
  const Result result = run("explain --quiet --local " + quoted(file("deep.json", text)));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("names: is nested too deep"), std::string::npos) << result.err;
}

TEST_F(Explain, OtherKeysMayBeNestedDeep) {
  for (const bool before : {true, false}) {
    std::string text = arm().dump();
    const std::string more = "\"more\":" + std::string(5000, '[') + std::string(5000, ']');
    text.insert(before ? 1 : text.size() - 1, before ? more + "," : "," + more);
    const Result result = run("explain --quiet --local " + quoted(file("deep.json", text)));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(result.out.find("strength"), std::string::npos) << result.out;
  }
}

TEST_F(Explain, ConvertedJsonKeepsItsNames) {
  Json problem = arm();
  problem["names"]["pairs"] = {"Knie \u00e4u\u00dfen"};
  const std::string path = file("arm.json", problem.dump()), copy = directory_.file("copy.json");
  for (const auto& [in, input] :
       {std::pair{quoted(path), std::string("/dev/null")}, std::pair{std::string("-"), path}}) {
    const Result converted = run("convert " + in + " " + quoted(copy), input);
    EXPECT_EQ(converted.exit_code, 0);
    EXPECT_EQ(converted.err, "");
    EXPECT_EQ(Json::parse(read_file(copy))["names"], problem["names"]) << in;
  }
  EXPECT_EQ(parts_of("explain --quiet --local " + quoted(copy)),
            parts_of("explain --quiet --local " + quoted(path)));
  const Result binary = run("convert " + quoted(path) + " " + quoted(directory_.file("arm.pb")));
  EXPECT_EQ(binary.exit_code, 0);
  EXPECT_NE(binary.err.find("has no place for names: left out"), std::string::npos) << binary.err;
}

TEST_F(Explain, ConvertRefusesNamesThatDoNotFit) {
  Json problem = arm();
  problem["names"]["pairs"] = {"touch", "slip"};
  const Result result =
      run("convert " + quoted(file("arm.json", problem.dump())) + " " + quoted(directory_.file("copy.json")));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("names.pairs: must be an array of 1 texts"), std::string::npos) << result.err;
}

TEST_F(Explain, NamesOfOthersDoNotSteerTheTerminal) {
  Json problem = arm();
  problem["names"]["equalities"] = {"\u202e\x1b]0;owned\x07"};
  problem["names"]["variables"][0] = std::string(100000, 'x');
  for (const std::string format : {"", " --output json"}) {
    const Result result = explained(problem, "--local" + format);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.out.find('\x1b'), std::string::npos);
    EXPECT_EQ(result.out.find("\u202e"), std::string::npos);
    EXPECT_LT(result.out.size(), 10000U);
  }
}

}  // namespace
}  // namespace marble::testing
