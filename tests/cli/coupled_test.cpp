// marble coupled: problems that rows tie together, and a long one in segments.
#include <cstdlib>

#include "cli_test.h"

namespace marble::testing {
namespace {

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

}  // namespace
}  // namespace marble::testing
