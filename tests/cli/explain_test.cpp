// `marble explain`: conflicts by the names of the file, locally and on a server, and names that are no names.
#include "cli_test.h"

namespace marble::testing {
namespace {

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
