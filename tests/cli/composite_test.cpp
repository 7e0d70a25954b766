#include <cstdlib>

#include "cli_test.h"

namespace marble::testing {
namespace {

// marble coupled: problems that rows tie together, and a long one in segments.

// ½(force − 3)² and ½(force − 2)², force ≥ 0.
constexpr const char* kLeft = R"({"n":1,"g":[-3],"Q":{"rows":1,"cols":1,"i":[0],"j":[0],"v":[1]},)"
                              R"("C":{"rows":1,"cols":1,"i":[0],"j":[0],"v":[1]},"d":[0]})";
constexpr const char* kRight = R"({"n":1,"g":[-2],"Q":{"rows":1,"cols":1,"i":[0],"j":[0],"v":[1]},)"
                               R"("C":{"rows":1,"cols":1,"i":[0],"j":[0],"v":[1]},"d":[0]})";
constexpr const char* kForce = R"({"rows":1,"cols":1,"i":[0],"j":[0],"v":[1]})";

class CoupledCommand : public Cli {
 protected:
  void SetUp() override {
    file("left.json", kLeft);
    file("right.json", kRight);
  }
  std::string cell(const std::string& coupling = kForce) {
    return file("cell.json", R"({"coupling_rhs":[4],"blocks":[{"problem":"left.json","coupling":)" +
                                 coupling + R"(},{"problem":"right.json","coupling":)" + kForce + "}]}");
  }
  Result marble(const std::string& arguments) {
    return run("coupled --server " + server_.address() + " " + arguments);
  }

  ServerProcess server_{MARBLE_SERVER_BINARY};
};

TEST_F(CoupledCommand, ReportsALineAnIterationAndThenTheAnswer) {
  const Result text = marble(quoted(cell()));
  ASSERT_EQ(text.exit_code, 0) << text.err;
  EXPECT_NE(text.out.find("price step"), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("solved: objective "), std::string::npos) << text.out;
  for (const std::string& where :
       {"--server " + server_.address(), "--sessions --server " + server_.address(),
        std::string("--server local")}) {
    const auto lines = run("coupled --output json " + where + " " + quoted(cell())).lines();
    ASSERT_GE(lines.size(), 2U) << where;
    EXPECT_EQ(lines[0]["iteration"], 1);
    EXPECT_EQ(lines.back()["status"], "solved");
    EXPECT_NEAR(lines.back()["coupling_multipliers"][0].get<double>(), 0.5, 1e-7);
    EXPECT_NEAR(lines.back()["z"][0][0].get<double>(), 2.5, 1e-7);
    EXPECT_NEAR(lines.back()["z"][1][0].get<double>(), 1.5, 1e-7);
  }
}

TEST_F(CoupledCommand, CutsALongProblemIntoSegments) {
  const Result example = run("example hopper --steps 12");
  ASSERT_EQ(example.exit_code, 0) << example.err;
  const std::string hopper = file("hopper.json", example.out);
  const auto whole = run("solve --output json --server " + server_.address() + " " + quoted(hopper)).lines();
  const auto n = whole.back()["z"].size();
  const auto lines =
      marble("--output json --segments 2 --stage-variables " + std::to_string(n / 12) + " " + quoted(hopper))
          .lines();
  ASSERT_GE(lines.size(), 2U);
  EXPECT_EQ(lines.back()["status"], "solved");
  EXPECT_EQ(lines.back()["z"].size(), n);
  EXPECT_EQ(lines.back()["coordination"]["status"], "solved");
}

TEST_F(CoupledCommand, NamesWhatIsWrongWithAFile) {
  const auto refused = [&](const std::string& arguments, const std::string& words) {
    const Result result = marble(arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    EXPECT_NE(result.err.find(words), std::string::npos) << result.err;
  };
  refused("nothing.json", "nothing.json");
  refused(quoted(file("list.json", "[]")), "must be a JSON object");
  refused(quoted(file("none.json", R"({"coupling_rhs":[4]})")), "blocks: must be a list");
  refused(quoted(file("away.json", R"({"coupling_rhs":[4],"blocks":[{"problem":"away"}]})")),
          "blocks[0].problem (away)");
  refused(quoted(cell(R"({"rows":1,"cols":1,"i":[0],"j":[0]})")), "blocks[0].coupling.v: must be there");
  refused(quoted(cell(R"({"rows":2,"cols":1,"i":[0],"j":[0],"v":[1]})")), "blocks[0].coupling.rows");
  refused("--segments 2 left.json", "--stage-variables");
}

// marble scenarios: one plan for many scenarios.

// (x, y): bought for 1 each, sold for 3, no more than demand; storing costs x² / 20.
constexpr const char* kShop = R"({"n":2,"g":[1,-3],"Q":{"rows":2,"cols":2,"i":[0],"j":[0],"v":[0.1]},)"
                              R"("L":{"rows":1,"cols":2,"i":[0],"j":[1],"v":[-1]},"l":[5],)"
                              R"("R":{"rows":1,"cols":2,"i":[0,0],"j":[0,1],"v":[1,-1]},"r":[0]})";

constexpr const char* kDemand = R"({"seed": 7, "first_stage": [0], "quantities": [
  {"distribution": "uniform", "location": -5, "scale": 10, "effects": [{"part": "l"}]}]})";

class ScenarioCommand : public Cli {
 protected:
  Result marble(const std::string& arguments) {
    return run("scenarios " + quoted(file("shop.json", kShop)) + " --server " + server_.address() + " " +
               arguments);
  }
  std::string samples(const std::string& arrays) {
    const std::string path = file("samples.npz", "");
    const std::string command =
        "/usr/bin/python3 -c 'import numpy; numpy.savez(\"" + path + "\", " + arrays + ")'";
    EXPECT_EQ(std::system(command.c_str()), 0);
    return quoted(path);
  }

  ServerProcess server_{MARBLE_SERVER_BINARY};
};

TEST_F(ScenarioCommand, ReportsALineAStageAndThenThePlan) {
  const std::string arrays =
      samples("l=[[float(d)] for d in (1, 9, 3, 7, 2, 8, 4, 6)], first_stage=[0], weights=[1.0] * 8");
  const Result text = marble("--samples " + arrays);
  ASSERT_EQ(text.exit_code, 0) << text.err;
  EXPECT_NE(text.out.find("in other scenarios, 95 %"), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("samples: solved; the plan is for 8 scenarios"), std::string::npos) << text.out;
  const auto lines = marble("--output json --samples " + arrays).lines();
  ASSERT_EQ(lines.size(), 5U);
  EXPECT_EQ(lines[3]["scenarios"], 8);
  EXPECT_TRUE(lines[3]["out_of_sample"].is_null());
  EXPECT_EQ(lines[2]["out_of_sample"]["scenarios"], 4);
  EXPECT_EQ(lines[4]["end"], "samples");
  EXPECT_EQ(lines[4]["x"].size(), 1U);
}

TEST_F(ScenarioCommand, HasTheSameBitsInThisProcess) {
  const std::string sampler =
      "--output json --max-sample-size 16 --sampler " + quoted(file("demand.json", kDemand));
  const auto there = marble(sampler).lines();
  const auto here =
      run("scenarios " + quoted(file("shop.json", kShop)) + " --server local " + sampler).lines();
  ASSERT_EQ(there.size(), 6U);
  ASSERT_EQ(here.size(), there.size());
  for (std::size_t i = 0; i + 1 < there.size(); ++i) {
    EXPECT_EQ(here[i]["objective"], there[i]["objective"]);
    EXPECT_EQ(here[i]["out_of_sample"], there[i]["out_of_sample"]);
  }
  EXPECT_EQ(here[5]["x"], there[5]["x"]);
}

TEST_F(ScenarioCommand, EndsWhenTheIntervalIsSmall) {
  const Result result =
      marble("--output json --initial-sample-size 16 --max-sample-size 1024 --tolerance 0.1 --sampler " +
             quoted(file("demand.json", kDemand)));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.lines().back()["end"], "interval");
}

TEST_F(ScenarioCommand, NamesWhatIsWrongWithAFile) {
  const auto refused = [&](const std::string& arguments, const std::string& words) {
    const Result result = marble(arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    EXPECT_NE(result.err.find(words), std::string::npos) << result.err;
  };
  refused("", "--samples or --sampler");
  refused("--samples nothing.npz", "nothing.npz");
  refused("--samples " + samples("l=[[1.0], [2.0]], first_stage=[7]"), "first_stage[0] = 7");
  refused("--samples " + samples("l=[[1.0], [2.0]], c0=[1.0], first_stage=[0]"), "a row for each scenario");
  refused("--samples " + samples("height=[1.0]"), "is no array of samples");
  refused("--samples " + samples("l=[[1.0]]") + " --first-stage 0,x", "--first-stage");
  refused("--sampler " + quoted(file("bad.json", R"({"quantities": [{"distribution": "cauchy"}]})")),
          "quantities[0].distribution = cauchy");
}

}  // namespace
}  // namespace marble::testing
