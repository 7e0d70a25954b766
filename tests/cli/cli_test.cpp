// The contract of the program `marble`: exit codes, what goes to which stream, and what a bad file is told.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "support/server_process.h"

namespace marble::testing {
namespace {

using Json = nlohmann::json;

class Cli : public ::testing::Test {
 protected:
  struct Result {
    int exit_code;
    std::string out, err;
    [[nodiscard]] std::vector<Json> lines() const {
      std::vector<Json> all;
      std::istringstream stream(out);
      for (std::string line; std::getline(stream, line);) all.push_back(Json::parse(line));
      return all;
    }
  };

  // Runs marble by a shell, so that the streams can be told apart and standard input be given.
  Result run(const std::string& arguments, const std::string& input = "/dev/null",
             const std::string& before = "") {
    const std::string out = directory_.file("out " + std::to_string(++runs_));
    const std::string err = directory_.file("err " + std::to_string(runs_));
    const std::string command =
        before + " '" MARBLE_BINARY "' " + arguments + " <'" + input + "' >'" + out + "' 2>'" + err + "'";
    ChildProcess shell({"/bin/sh", "-c", command}, directory_.file("shell"));
    const int code = shell.wait();
    return {code, read_file(out), read_file(err)};
  }
  std::string file(const std::string& name, const std::string& content) {
    const std::string path = directory_.file(name);
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }
  static std::string quoted(const std::string& path) { return "'" + path + "'"; }

  TemporaryDirectory directory_;
  int runs_ = 0;
};

// min z₁² + z₂² − 2z₁ + 1, 0 ≤ z₂ ⊥ z₂ − z₁ ≥ 0; optimum ½.
constexpr const char* kGood =
    R"({"n":2,"c0":1,"g":[-2,0],"Q":{"rows":2,"cols":2,"i":[0,1],"j":[0,1],"v":[2,2]},)"
    R"("L":{"rows":1,"cols":2,"i":[0],"j":[1],"v":[1]},"l":[0],)"
    R"("R":{"rows":1,"cols":2,"i":[0,0],"j":[0,1],"v":[-1,1]},"r":[0],"best_known_objective":0.5})";

// min z, z ≥ 2, z ≤ 1.
constexpr const char* kInfeasible =
    R"({"n":1,"g":[1],"C":{"rows":2,"cols":1,"i":[0,1],"j":[0,0],"v":[1,-1]},"d":[-2,1]})";

TEST_F(Cli, SolvesLocallyAndExitsZero) {
  const Result result = run("solve --local " + quoted(file("good.json", kGood)));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("good: solved"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("objective       0.5"), std::string::npos) << result.out;
  EXPECT_NE(result.err.find("objective"), std::string::npos) << "the table goes to standard error";
  EXPECT_EQ(result.err.find('\033'), std::string::npos) << "no colours where there is no terminal";
}

TEST_F(Cli, QuietPrintsNoTable) {
  const Result result = run("solve --local --quiet " + quoted(file("good.json", kGood)));
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.err, "");
}

TEST_F(Cli, JsonIsOneObjectALineInTheOrderOfTheFiles) {
  const std::string good = quoted(file("good.json", kGood));
  const std::string bad = quoted(file("bad.json", "{"));
  const Result result = run("solve --local --quiet --output json " + good + " " + bad + " " + good);
  EXPECT_EQ(result.exit_code, 2);
  const auto lines = result.lines();
  ASSERT_EQ(lines.size(), 3U);
  for (const char* key : {"name", "status", "objective", "z", "equality_multipliers",
                          "inequality_multipliers", "complementarity_multipliers", "violations",
                          "kkt_residual", "iterations", "factorizations", "solve_seconds", "queue_seconds"}) {
    EXPECT_TRUE(lines[0].contains(key)) << key;
  }
  EXPECT_EQ(lines[0]["status"], "solved");
  EXPECT_EQ(lines[0]["z"].size(), 2U);
  EXPECT_EQ(lines[0]["complementarity_multipliers"]["L"].size(), 1U);
  EXPECT_EQ(lines[0]["complementarity_multipliers"]["R"].size(), 1U);
  for (const char* key : {"equality", "inequality", "complementarity"})
    EXPECT_TRUE(lines[0]["violations"].contains(key));
  EXPECT_EQ(lines[1]["status"], "error");
  EXPECT_EQ(lines[1]["error"]["code"], "invalid_argument");
  EXPECT_EQ(lines[2]["status"], "solved");
}

TEST_F(Cli, NotSolvedExitsOne) {
  const Result result = run("solve --local --quiet --output json " + quoted(file("no.json", kInfeasible)));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.lines().at(0)["status"], "infeasible");
  const Result limited =
      run("solve --local --quiet --option max_iterations=1 " + quoted(file("good.json", kGood)));
  EXPECT_EQ(limited.exit_code, 1);
  EXPECT_NE(limited.out.find("iteration_limit"), std::string::npos);
}

TEST_F(Cli, UsageErrorsExitTwoAndSayWhatIsWrong) {
  EXPECT_EQ(run("").exit_code, 2);
  EXPECT_EQ(run("solve").exit_code, 2);
  EXPECT_EQ(run("solve --no-such-flag x").exit_code, 2);
  const std::string good = quoted(file("good.json", kGood));
  const Result option = run("solve --local --option kappa_factor=2 " + good);
  EXPECT_EQ(option.exit_code, 2);
  EXPECT_NE(option.err.find("kappa_factor = 2: must be in [0.001, 0.99]"), std::string::npos) << option.err;
  EXPECT_NE(run("solve --local --option nonsense=1 " + good).err.find("nonsense: is not an option"),
            std::string::npos);
  EXPECT_EQ(run("solve --local --time-limit -1 " + good).exit_code, 2);
}

TEST_F(Cli, HelpDocumentsTheExitCodes) {
  for (const char* arguments : {"--help", "solve --help"}) {
    const Result result = run(arguments);
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_NE(result.out.find("0 all solved, 1 some not solved, 2 usage or bad file, 3 server unreachable"),
              std::string::npos)
        << result.out;
  }
}

TEST_F(Cli, AnUnreachableServerExitsThree) {
  const Result result = run("solve --quiet --server 127.0.0.1:1 " + quoted(file("good.json", kGood)));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("127.0.0.1:1"), std::string::npos) << result.err;
  EXPECT_EQ(run("health --server 127.0.0.1:1").exit_code, 3);
  EXPECT_EQ(run("info", "/dev/null", "MARBLE_SERVER=unix:/nonexistent").exit_code, 3);
}

TEST_F(Cli, StandardInputIsAFileToo) {
  const Result result = run("solve --local --quiet -", file("good.json", kGood));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("solved"), std::string::npos);
}

TEST_F(Cli, InitialPointOfTheFileIsUsed) {
  Json json = Json::parse(kGood);
  json["x0"] = {0.5, 0.5};
  EXPECT_EQ(run("solve --local --quiet " + quoted(file("start.json", json.dump()))).exit_code, 0);
  json["x0"] = {0.5};
  EXPECT_NE(run("solve --local --quiet " + quoted(file("start.json", json.dump()))).err.find("x0"),
            std::string::npos);
}

TEST_F(Cli, ConvertsThereAndBackToTheBit) {
  run("example rocket --seed 3");
  const std::string json = file("rocket.json", run("example rocket --seed 3").out);
  const std::string binary = directory_.file("rocket.pb");
  const std::string back = directory_.file("back.json");
  ASSERT_EQ(run("convert " + quoted(json) + " " + quoted(binary)).exit_code, 0);
  ASSERT_EQ(run("convert " + quoted(binary) + " " + quoted(back)).exit_code, 0);
  EXPECT_EQ(read_file(json), read_file(back));
  EXPECT_LT(read_file(binary).size(), read_file(json).size());
  EXPECT_EQ(run("convert " + quoted(json) + " " + quoted(directory_.file("rocket.xyz"))).exit_code, 2);
}

TEST_F(Cli, ExamplesAreTheSameForASeed) {
  EXPECT_EQ(run("example gates --seed 5").out, run("example gates --seed 5").out);
  EXPECT_NE(run("example gates --seed 5").out, run("example gates --seed 6").out);
  EXPECT_EQ(run("example hopper --steps 1").exit_code, 2);
  EXPECT_EQ(run("example unicycle").exit_code, 2);
}

TEST_F(Cli, OptionsAreListedWithDefaultAndRange) {
  const Result result = run("options");
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_NE(result.out.find("path = fast   in fast, paper"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("kappa_factor = 0.5   in [0.001, 0.99]"), std::string::npos) << result.out;
}

struct BadFile {
  const char* name;
  std::string content;
  const char* message;  // part of what must be said, after the file's name
};

// Noise that is the same each time.
std::string noise(std::size_t size) {
  std::string bytes(size, '\0');
  std::uint32_t state = 12345;
  for (char& byte : bytes) {
    state = state * 1664525U + 1013904223U;
    byte = static_cast<char>(state >> 24);
  }
  return bytes;
}

std::string with(const char* key, const std::string& value) {
  Json json = Json::parse(kGood);
  json.erase(key);
  std::string text = json.dump();
  text.insert(1, std::string("\"") + key + "\":" + value + ",");
  return text;
}

class BadFiles : public Cli, public ::testing::WithParamInterface<BadFile> {};

TEST_P(BadFiles, GetAnErrorThatNamesFileFieldAndRuleLocallyAndRemotely) {
  const std::string path = file(std::string(GetParam().name) + ".json", GetParam().content);
  ServerProcess server(MARBLE_SERVER_BINARY);
  for (const std::string& where : {std::string("--local"), "--server " + server.address()}) {
    const Result result = run("solve --quiet --output json " + where + " " + quoted(path));
    EXPECT_EQ(result.exit_code, 2) << where;
    EXPECT_NE(result.err.find(std::string(GetParam().name) + ".json: "), std::string::npos) << result.err;
    EXPECT_NE(result.err.find(GetParam().message), std::string::npos) << result.err;
    EXPECT_LT(result.err.size(), 1000U);
    EXPECT_EQ(result.lines().at(0)["status"], "error");
  }
  EXPECT_EQ(run("health --server " + server.address()).out, "serving\n");
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, BadFiles,
    ::testing::Values(
        BadFile{"truncated", std::string(kGood).substr(0, 90), "is not JSON"},
        BadFile{"noise", noise(10'000'000), "is not JSON"}, BadFile{"empty", "", "is not JSON"},
        BadFile{"array", "[1, 2]", "must be a JSON object"},
        BadFile{"no_variables", with("n", "0"), "n = 0: must be a whole number in [1, 2^28)"},
        BadFile{"huge_n", with("n", "1e300"), "n = 1e+300: must be a whole number"},
        BadFile{"text_n", with("n", "\"two\""), "n = \"two\": must be a number"},
        BadFile{"short_gradient", with("g", "[1]"), "g = 1 entries: must have 2 entries"},
        BadFile{"nan", with("g", "[1, NaN]"), "is not JSON"},
        BadFile{"null_entry", with("g", "[1, null]"), "g[1] = null: must be a finite number"},
        BadFile{"infinite", with("g", "[1, 1e999]"), "is not JSON"},
        BadFile{"row_out_of_range", with("L", R"({"rows":1,"cols":2,"i":[1],"j":[0],"v":[1]})"),
                "L.i[0] = 1: must be in [0, 1)"},
        BadFile{"column_out_of_range", with("L", R"({"rows":1,"cols":2,"i":[0],"j":[2],"v":[1]})"),
                "L.j[0] = 2: must be in [0, 2)"},
        BadFile{"negative_index", with("L", R"({"rows":1,"cols":2,"i":[-1],"j":[0],"v":[1]})"),
                "L.i[0] = -1: must be in [0, 1)"},
        BadFile{"fractional_index", with("L", R"({"rows":1,"cols":2,"i":[0.5],"j":[0],"v":[1]})"),
                "L.i[0] = 0.5: must be a whole number"},
        BadFile{"wrong_columns", with("L", R"({"rows":1,"cols":3,"i":[0],"j":[0],"v":[1]})"),
                "L.cols = 3: must be 2 (n)"},
        BadFile{"huge_columns", with("L", R"({"rows":1,"cols":200000000,"i":[0],"j":[0],"v":[1]})"),
                "L.cols = 200000000: must be 2 (n)"},
        BadFile{"rows_without_offsets", with("L", R"({"rows":2,"cols":2,"i":[0],"j":[0],"v":[1]})"),
                "L.rows = 2: must be 1"},
        BadFile{"negative_rows", with("L", R"({"rows":-1,"cols":2,"i":[],"j":[],"v":[]})"),
                "L.rows = -1: must be"},
        BadFile{"missing_values", with("L", R"({"rows":1,"cols":2,"i":[0],"j":[0]})"), "L.v: is missing"},
        BadFile{"uneven_triplets", with("L", R"({"rows":1,"cols":2,"i":[0],"j":[0,1],"v":[1,1]})"),
                "L.i = 1 entries: must have 2 entries"},
        BadFile{"uneven_pairs", with("r", "[0, 1]"), "r = 2 entries: must have 1 entries"},
        BadFile{"asymmetric", with("Q", R"({"rows":2,"cols":2,"i":[0,0],"j":[0,1],"v":[2,1]})"),
                "Q must be symmetric"},
        BadFile{"deep", std::string(100'000, '['), "is not JSON"}),
    [](const auto& parameter) { return parameter.param.name; });

TEST_F(Cli, TruncatedBinaryIsRefused) {
  const std::string json = file("good.json", kGood);
  const std::string binary = directory_.file("good.pb");
  ASSERT_EQ(run("convert " + quoted(json) + " " + quoted(binary)).exit_code, 0);
  const std::string content = read_file(binary);
  const Result cut =
      run("solve --local --quiet " + quoted(file("cut.pb", content.substr(0, content.size() / 2))));
  EXPECT_EQ(cut.exit_code, 2);
  EXPECT_NE(cut.err.find("cut.pb: "), std::string::npos) << cut.err;
  EXPECT_EQ(run("solve --local --quiet " + quoted(file("noise.pb", noise(10'000'000)))).exit_code, 2);
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
  EXPECT_EQ(run("solve --quiet " + good, "/dev/null", "MARBLE_SERVER='" + server.address() + "'").exit_code,
            0);
  const Result info = run("info --output json --server " + server.address());
  EXPECT_EQ(info.exit_code, 0);
  EXPECT_EQ(info.lines().at(0)["solved"], 3);
}

TEST_F(Cli, RemoteTableHasEveryIteration) {
  ServerProcess server(MARBLE_SERVER_BINARY);
  const std::string rocket = quoted(file("rocket.json", run("example rocket").out));
  const Result local = run("solve --local " + rocket);
  const Result remote = run("solve --server " + server.address() + " " + rocket);
  EXPECT_EQ(local.err, remote.err);
}

}  // namespace
}  // namespace marble::testing
