#include "cli_test.h"

#include <filesystem>

namespace marble::testing {
namespace {

// The contract of the program `marble`: exit codes, what goes to which stream, and what a bad file is
// reported.
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
  const Result result = run("solve --local --quiet --output json " + quoted(file("no.json", kUnsolvable)));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.lines().at(0)["status"], "solved");
  EXPECT_EQ(result.lines().at(0)["z"].size(), 1U) << "the best iterate";
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
  EXPECT_NE(run("solve --local --option relative_gap_tolerance=1 " + good)
                .err.find("relative_gap_tolerance = 1: must be in [0, 0.9"),
            std::string::npos);
  EXPECT_NE(run("solve --local --option node_limit=0 " + good).err.find("node_limit = 0: must be in [1, "),
            std::string::npos);
  EXPECT_NE(run("solve --local --option nonsense=1 " + good).err.find("nonsense: is not an option"),
            std::string::npos);
  const Result method = run("solve --local --option method=alag " + good);
  EXPECT_EQ(method.exit_code, 2);
  EXPECT_NE(method.err.find("method = alag: must be marble; `marble compare`"), std::string::npos)
      << method.err;
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

TEST_F(Cli, ExamplesOfMacmpecAreSolvedAndTheOthersAreListed) {
  const Json problem = Json::parse(run("example macmpec nash1d").out);
  EXPECT_EQ(problem["name"], "nash1d");
  EXPECT_EQ(problem["best_known_objective"], 0.0);
  EXPECT_EQ(problem["x0"], Json({10.0, 0.0, 0.0, 0.0, 0.0, 0.0}));
  const std::string bard2 = file("bard2.json", run("example macmpec bard2").out);
  EXPECT_NE(run("solve --local --quiet " + quoted(bard2)).out.find("-6598   (best known -6598)"),
            std::string::npos);

  for (const std::string problem_name : {"", "bard3", "../bard1", "bard1.json"}) {
    const Result listed = run("example macmpec " + problem_name);
    EXPECT_EQ(listed.exit_code, 2) << problem_name;
    EXPECT_EQ(listed.out, "") << problem_name;
    EXPECT_NE(listed.err.find("flp4_4       200        100    0\n"), std::string::npos) << listed.err;
    EXPECT_EQ(std::ranges::count(listed.err, '\n'), 41) << listed.err;
    EXPECT_NE(listed.err.find(problem_name), std::string::npos);
  }
  for (const std::string wrong :
       {"macmpec jr1 --paper", "macmpec jr1 --steps 4", "macmpec jr1 --seed 1", "qpec --steps 4",
        "rocket jr1", "qpec --paper", "robots --paper", "rocket3d --seed 1", "robots --steps 1"})
    EXPECT_EQ(run("example " + wrong).exit_code, 2) << wrong;
}

TEST_F(Cli, OptionsAreListedWithDefaultAndRange) {
  const Result result = run("options");
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_NE(result.out.find("path                       fast     in fast, paper, algorithm1"),
            std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("kappa_factor               0.5      in [0.001, 0.99]"), std::string::npos)
      << result.out;
}

TEST_F(Cli, ABadFileDoesNotStopTheRestAndTheWorstOutcomeIsTheExitCode) {
  const std::string unsolved = quoted(file("no.json", kUnsolvable));
  const std::string missing = quoted(directory_.file("missing.json"));
  const std::string good = quoted(file("good.json", kGood));
  const Result result =
      run("solve --local --quiet --output json " + missing + " " + unsolved + " '/' " + good);
  EXPECT_EQ(result.exit_code, 2);
  const auto lines = result.lines();
  ASSERT_EQ(lines.size(), 4U);
  EXPECT_EQ(lines[0]["error"]["code"], "not_found");
  EXPECT_NE(lines[1]["status"], "solved");
  EXPECT_FALSE(lines[1].contains("error")) << "an answer, not an error";
  EXPECT_EQ(lines[2]["error"]["code"], "invalid_argument") << "a directory without a problem in it";
  EXPECT_EQ(lines[3]["status"], "solved");
}

TEST_F(Cli, ErrorsOfAFileAreStructured) {
  Json json = Json::parse(kGood);
  json["L"]["j"][0] = 5;
  const Json line =
      run("solve --local --quiet --output json " + quoted(file("bad.json", json.dump()))).lines().at(0);
  EXPECT_EQ(line["file"], directory_.file("bad.json"));
  EXPECT_EQ(line["error"]["code"], "invalid_argument");
  EXPECT_EQ(line["error"]["field"], "L.j");
  EXPECT_EQ(line["error"]["index"], 0);
  EXPECT_EQ(line["error"]["value"], "5");
  EXPECT_EQ(line["error"]["bound"], "must be in [0, 2)");
  EXPECT_EQ(line["error"]["message"], "L.j[0] = 5: must be in [0, 2)");
}

TEST_F(Cli, TheBestKnownObjectiveIsPassedOn) {
  const std::string good = quoted(file("good.json", kGood));
  EXPECT_EQ(run("solve --local --quiet --output json " + good).lines().at(0)["best_known_objective"], 0.5);
  EXPECT_NE(run("solve --local --quiet " + good).out.find("(best known 0.5)"), std::string::npos);
}

TEST_F(Cli, ReportsTheDerivativesThatAFileAsksForHereAndFromAServer) {
  const std::string good = quoted(file("good.json", kGood));
  const std::string ask = quoted(file("ask.json", R"({"directions":[{"g":[1,0]},{"r":[1],"Q":[1,0]}],
      "losses":[{"z":[1,0]}],"rows":{"E":[[1,0]],"columns":true}})"));
  const Result here = run("solve --local --quiet --output json --sensitivity " + ask + " " + good);
  ASSERT_EQ(here.exit_code, 0) << here.err;
  const Json reported = here.lines().at(0)["sensitivity"];
  EXPECT_EQ(reported["smooth"], true);
  EXPECT_NEAR(reported["changes"][0]["z"][1].get<double>(), -0.25, 1e-9);
  EXPECT_NEAR(reported["changes"][1]["z"][0].get<double>(), 0.375, 1e-9)
      << "z₁ = (2 + 2r) / (4 + q), r and q rise";
  EXPECT_EQ(reported["changes"][0]["active_set_constant"], true);
  EXPECT_NEAR(reported["gradients"][0]["g"][1].get<double>(), -0.25, 1e-9);
  EXPECT_NEAR(reported["rows"]["response"][0][0].get<double>(), 0.25, 1e-9);
  EXPECT_EQ(reported["rows"]["values"][0], here.lines().at(0)["z"][0]);

  ServerProcess server(MARBLE_SERVER_BINARY);
  const std::string there = "solve --quiet --server " + server.address() + " --sensitivity " + ask + " ";
  EXPECT_EQ(run(there + "--output json " + good).lines().at(0)["sensitivity"], reported);
  EXPECT_NE(run(there + good).out.find("derivatives     2 directions, 1 loss, 1 row\n"), std::string::npos);
  EXPECT_EQ(run(there + quoted(file("never.json", kUnsolvable))).exit_code, 2) << "of another size";
}

TEST_F(Cli, WhatAFileAsksOfDerivativesIsReportedWhereItDoesNotFit) {
  const std::string good = quoted(file("good.json", kGood));
  const auto refused = [&](const std::string& ask) {
    const Result result =
        run("solve --local --quiet --sensitivity " + quoted(file("ask.json", ask)) + " " + good);
    EXPECT_EQ(result.exit_code, 2) << result.out;
    return result.err;
  };
  EXPECT_NE(refused("[").find("must be a file of JSON"), std::string::npos);
  EXPECT_NE(refused("[]").find("sensitivity: must be an object"), std::string::npos);
  EXPECT_NE(refused(R"({"direction":[]})").find("sensitivity.direction: must be directions, losses or rows"),
            std::string::npos);
  EXPECT_NE(refused(R"({"directions":[{},{"b":[1]}]})")
                .find("sensitivity.directions[1].b = 1 entries: must have 0"),
            std::string::npos);
  EXPECT_NE(
      refused(R"({"losses":[{"z":[1,"a"]}]})").find("sensitivity.losses[0].z[1] = \"a\": must be a number"),
      std::string::npos);
  EXPECT_NE(refused(R"({"rows":{}})").find("sensitivity.rows.E: must be a list"), std::string::npos);
  EXPECT_NE(refused(R"({"rows":{"E":[[1,0]],"proximal":[1,-1]}})").find("must be >= 0"), std::string::npos);
  EXPECT_EQ(run("solve --local --sensitivity nowhere.json " + good).exit_code, 2);
}

TEST_F(Cli, TheTimeLimitIsAnAnswer) {
  const Result result =
      run("solve --local --quiet --time-limit 0 --output json " + quoted(file("good.json", kGood)));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.lines().at(0)["status"], "time_limit");
  EXPECT_EQ(result.lines().at(0)["z"].size(), 2U);
  EXPECT_EQ(run("solve --local --time-limit nan " + quoted(file("good.json", kGood))).exit_code, 2);
}

TEST_F(Cli, StandardInputMayBeBinary) {
  const std::string binary = directory_.file("good.pb");
  ASSERT_EQ(run("convert " + quoted(file("good.json", kGood)) + " " + quoted(binary)).exit_code, 0);
  const Result result = run("solve --local --quiet -", binary);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("good: solved"), std::string::npos) << result.out;
}

TEST_F(Cli, ConvertSaysWhatTheBinaryFormatCannotHold) {
  Json json = Json::parse(kGood);
  json.erase("best_known_objective");
  const std::string out = " " + quoted(directory_.file("out.pb"));
  EXPECT_EQ(run("convert " + quoted(file("plain.json", json.dump())) + out).err, "");
  json["x0"] = {0.5, 0.5};
  const Result result = run("convert " + quoted(file("start.json", json.dump())) + out);
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_NE(result.err.find("out.pb: has no place for x0: left out"), std::string::npos) << result.err;
}

TEST_F(Cli, SaysItsVersion) {
  const Result version = run("version");
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_EQ(version.out.rfind("marble ", 0), 0U);
  EXPECT_EQ(run("--version").out, version.out);
}

// The program marble solves JSON files by itself; for all else it becomes the program with all commands.
class Start : public Cli {
 protected:
  // marble without the program beside it, run as by its user.
  Result run_alone(const std::string& arguments, const std::string& environment = "") {
    const std::string alone = directory_.file("marble");
    std::filesystem::copy_file(MARBLE_BINARY, alone, std::filesystem::copy_options::skip_existing);
    const std::string out = directory_.file("alone out"), err = directory_.file("alone err");
    ChildProcess process(
        {"/bin/sh", "-c",
         environment + " exec " + quoted(alone) + " " + arguments + " >" + quoted(out) + " 2>" + quoted(err)},
        directory_.file("alone shell"));
    const int code = process.wait();
    return {code, read_file(out), read_file(err)};
  }
  // An answer without its times.
  static Json untimed(const Result& result) {
    Json answer = result.lines().at(0);
    for (const char* part : {"solve", "setup", "factorization", "line_search", "polish", "tree"})
      answer.erase(std::string(part) + "_seconds");
    return answer;
  }

  const std::string good_ = quoted(file("good.json", kGood));
};

TEST_F(Start, OfALocalSolveOfJsonLoadsNoOtherProgram) {
  const Result one = run_alone("solve --local --quiet " + good_);
  EXPECT_EQ(one.exit_code, 0) << one.err;
  EXPECT_NE(one.out.find("good: solved"), std::string::npos) << one.out;
  const Result by_name = run_alone("solve --server local --output json " + good_ + " " + good_);
  EXPECT_EQ(by_name.exit_code, 0) << by_name.err;
  EXPECT_EQ(by_name.lines().size(), 2U);
}

TEST_F(Start, OfALocalSolveLoadsNoLibraryOfTheNetwork) {
  const Result libraries = run_alone("solve --local --quiet " + good_, "LD_TRACE_LOADED_OBJECTS=1");
  ASSERT_NE(libraries.out.find("libc"), std::string::npos) << libraries.out;
  for (const char* name : {"grpc", "protobuf", "absl", "ssl", "libzip", "curses", "amplsolver"})
    EXPECT_EQ(libraries.out.find(name), std::string::npos) << libraries.out;
}

TEST_F(Start, TheSameFileHasTheSameAnswerFromBothPrograms) {
  const Result here = run("solve --local --quiet --output json " + good_);
  // Two files of which one is no JSON: the other program solves both.
  const std::string binary = quoted(directory_.file("good.pb"));
  ASSERT_EQ(run("convert " + good_ + " " + binary).exit_code, 0);
  const Result there = run("solve --local --quiet --output json " + good_ + " " + binary);
  ASSERT_EQ(there.exit_code, 0) << there.err;
  EXPECT_EQ(untimed(here), untimed(there));
}

TEST_F(Start, WithoutTheOtherProgramSaysWhichIsMissing) {
  for (const std::string& arguments :
       std::vector<std::string>{"version", "--help", "solve --help", "solve --local --no-such " + good_,
                                "solve --local " + quoted(file("good.pb", "")), "solve " + good_, ""}) {
    const Result result = run_alone(arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    EXPECT_EQ(result.out, "") << arguments;
    EXPECT_NE(result.err.find("marble-all: cannot be run: No such file or directory"), std::string::npos)
        << arguments << ": " << result.err;
  }
}

}  // namespace
}  // namespace marble::testing
