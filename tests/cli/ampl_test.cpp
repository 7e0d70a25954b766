// The program as a solver of AMPL's: what a front end calls, and what it finds in the .sol file.
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "cli_test.h"
#include "formats/nl_writer.h"
#include "marble/client.h"

namespace marble::testing {
namespace {

class Ampl : public Cli {
 protected:
  struct Sol {
    std::string message;
    std::vector<std::string> lines;  ///< from Options on
    [[nodiscard]] std::string code() const {
      for (const std::string& line : lines) {
        if (line.starts_with("objno 0 ")) return line.substr(8);
      }
      return "none";
    }
    /// The lines of a suffix, index and value.
    [[nodiscard]] std::vector<std::string> suffix(const std::string& name) const {
      for (std::size_t k = 0; k + 1 < lines.size(); ++k) {
        if (!lines[k].starts_with("suffix ") || lines[k + 1] != name) continue;
        std::size_t count = 0;
        int kind = 0;
        std::istringstream(lines[k].substr(7)) >> kind >> count;
        return {lines.begin() + static_cast<std::ptrdiff_t>(k + 2),
                lines.begin() + static_cast<std::ptrdiff_t>(k + 2 + count)};
      }
      return {};
    }
  };

  /// min (x0 - 1)^2 + x1^2 with x1 >= 0 complements x1 - x0 >= 0, and x0 + x1 >= `least`, both at most 10.
  static std::string corner(double least, bool binary = false, int operation = 0) {
    NlWriter nl(binary, 2, 2, 1);
    nl.key('C').integer(0).constant(0.0);
    nl.key('C').integer(1);
    operation == 0 ? nl.constant(0.0) : nl.operation(operation).variable(0);
    nl.key('O').integer(0).integer(0).operation(0);
    nl.operation(5).operation(1).variable(0).constant(1.0).constant(2.0);
    nl.operation(2).variable(1).variable(1);
    nl.key('r').complements(1, 1).at_least(least);
    nl.key('b').at_most(10.0).between(0.0, 10.0);
    nl.key('k').integer(1).line().integer(2);
    nl.key('J').integer(0).integer(2).entry(0, -1.0).entry(1, 1.0);
    nl.key('J').integer(1).integer(2).entry(0, 1.0).entry(1, 1.0);
    nl.key('G').integer(0).integer(2).entry(0, 0.0).entry(1, 0.0);
    return nl.content();
  }

  static Sol read_sol(const std::string& path) {
    Sol sol;
    std::istringstream text(read_file(path));
    std::string line;
    while (std::getline(text, line) && !line.empty()) sol.message += line + "\n";
    while (std::getline(text, line)) sol.lines.push_back(line);
    return sol;
  }

  /// Writes STUB.nl and has it solved as AMPL does; the program must say nothing and end well.
  Sol solve(const std::string& content, const std::string& words = "",
            const std::vector<std::string>& environment = {}) {
    const std::string path = file("model.nl", content);
    stub_ = path.substr(0, path.size() - 3);
    std::filesystem::remove(stub_ + ".sol");
    const Result result = run("'" + stub_ + "' -AMPL " + words, "/dev/null", environment);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err, "");
    out_ = result.out;
    return read_sol(stub_ + ".sol");
  }

  std::string stub_, out_;
};

TEST_F(Ampl, AnAnswerHasMessageSizesDualsPrimalsAndCode) {
  for (const bool binary : {false, true}) {
    const Sol sol = solve(corner(3.0, binary));
    EXPECT_TRUE(sol.message.starts_with("marble ")) << sol.message;
    EXPECT_NE(sol.message.find("solved; objective 2.5"), std::string::npos) << sol.message;
    EXPECT_EQ(out_, "") << "AMPL prints the message";
    ASSERT_GE(sol.lines.size(), 13U);
    EXPECT_EQ((std::vector<std::string>(sol.lines.begin(), sol.lines.begin() + 9)),
              (std::vector<std::string>{"Options", "3", "1", "1", "0", "2", "2", "2", "2"}));
    // x = (1.5, 1.5): 2 (x - 1, x) = dual (1, 1) of the sum and ξ (-1, 1) of the pair.
    const double expected[] = {1.0, 2.0, 1.5, 1.5};
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_NEAR(std::strtod(sol.lines[9 + k].c_str(), nullptr), expected[k], 1e-7) << k;
    EXPECT_EQ(sol.code(), "0");
    EXPECT_EQ(sol.suffix("rc").size(), 2U);
    EXPECT_EQ(sol.suffix("rc"), sol.suffix("lower_bound_duals")) << "no upper bound holds";
    EXPECT_EQ(sol.suffix("upper_bound_duals"), (std::vector<std::string>{"0 0", "1 0"}));
  }
}

TEST_F(Ampl, GlobalModeReportsBoundAndGap) {
  const Sol sol = solve(corner(3.0), "global_search=true");
  ASSERT_EQ(sol.suffix("bound").size(), 1U) << sol.message;
  EXPECT_NEAR(std::strtod(sol.suffix("bound")[0].c_str() + 2, nullptr), 2.5, 1e-5);
  EXPECT_EQ(sol.suffix("gap").size(), 1U);
  EXPECT_NE(sol.message.find("proved optimal"), std::string::npos) << sol.message;
}

// max 3 x0 + 5 x1 with x0 <= 4, 2 x1 <= 12, 3 x0 + 2 x1 <= 18: 36.
TEST_F(Ampl, AMaximumIsReportedAsTheFileHasItEverywhere) {
  const auto wyndor = [](double of_x0, double of_x1, bool pair = false) {
    NlWriter nl(false, 2, 3, 1);
    for (int row = 0; row < 3; ++row) nl.key('C').integer(row).constant(0.0);
    nl.key('O').integer(0).integer(1).constant(0.0);
    nl.key('r');
    pair ? nl.complements(1, 0) : nl.at_most(4.0);
    nl.at_most(12.0).at_most(18.0).key('b').at_least(0.0).at_least(0.0);
    nl.key('k').integer(1).line().integer(2);
    nl.key('J').integer(0).integer(1).entry(pair ? 1 : 0, 1.0);
    nl.key('J').integer(1).integer(1).entry(1, 2.0);
    nl.key('J').integer(2).integer(2).entry(0, 3.0).entry(1, 2.0);
    nl.key('G').integer(0).integer(2).entry(0, of_x0).entry(1, of_x1);
    return nl.content();
  };
  const std::string path = quoted(file("wyndor.nl", wyndor(3.0, 5.0)));
  const Result text = run("solve --local " + path);
  EXPECT_NE(text.out.find("  objective       36\n"), std::string::npos) << text.out;
  EXPECT_EQ((text.out + text.err).find("-3.6"), std::string::npos) << "the table: " << text.err;
  const Json json = run("solve --local --quiet --output json " + path).lines().at(0);
  EXPECT_NEAR(json["objective"].get<double>(), 36.0, 1e-9);
  EXPECT_TRUE(json["maximize"].get<bool>());
  // Of two variables of which one is 0: max 3 x0 + 5 x1 is 30, and so is the bound of it.
  const std::string paired = quoted(file("paired.nl", wyndor(3.0, 5.0, true)));
  const Json proved =
      run("solve --local --quiet --output json --option global_search=true " + paired).lines().at(0);
  EXPECT_NEAR(proved["objective"].get<double>(), 30.0, 1e-6) << proved;
  EXPECT_TRUE(proved["proved"].get<bool>()) << proved;
  EXPECT_NEAR(proved["bound"].get<double>(), 30.0, 1e-3) << proved;
  EXPECT_GE(proved["bound"].get<double>(), proved["objective"].get<double>() - 1e-9) << "an upper one";
  // A problem file has no place for it: that is said, and the negative is written.
  const Result converted = run("convert " + path + " " + quoted(directory_.file("wyndor.json")));
  EXPECT_NE(converted.err.find("is a maximum: its negative is minimized"), std::string::npos)
      << converted.err;
}

TEST_F(Ampl, WhatContradictsItselfNamesItsConstraints) {
  const Sol sol = solve(corner(21.0));
  EXPECT_EQ(sol.code(), "200") << sol.message;
  EXPECT_FALSE(sol.suffix("dunbdd").empty());
}

TEST_F(Ampl, AFallWithoutEndHasItsDirection) {
  NlWriter nl(false, 1, 0, 1);
  nl.key('O').integer(0).integer(1).constant(0.0);  // maximize x0 >= 2
  nl.key('b').at_least(2.0);
  nl.key('G').integer(0).integer(1).entry(0, 1.0);
  const Sol sol = solve(nl.content());
  EXPECT_EQ(sol.code(), "300") << sol.message;
  ASSERT_EQ(sol.suffix("unbdd").size(), 1U);
  EXPECT_GT(std::strtod(sol.suffix("unbdd")[0].c_str() + 2, nullptr), 0.0);
}

TEST_F(Ampl, OptionsComeFromTheEnvironmentAndTheCommandLineCounts) {
  EXPECT_EQ(solve(corner(3.0), "", {"marble_options=path=paper polish = false max_iterations=1"}).code(),
            "400");
  EXPECT_EQ(solve(corner(3.0), "max_iterations=1000", {"marble_options=max_iterations=1"}).code(), "0");
  const Sol wrong = solve(corner(3.0), "speed=high");
  EXPECT_EQ(wrong.code(), "520");
  EXPECT_NE(wrong.message.find("speed"), std::string::npos) << wrong.message;
  EXPECT_EQ(wrong.lines[6], "0") << "no duals";
  EXPECT_EQ(wrong.lines[8], "0") << "no primals";
}

TEST_F(Ampl, OutlevReportsOfEveryIteration) {
  static_cast<void>(solve(corner(3.0), "outlev=1"));
  EXPECT_NE(out_.find("objective"), std::string::npos) << out_;
}

TEST_F(Ampl, WhatJumpsIsRefusedWithTheConstraintsName) {
  file("model.row", "pairs\nheat[3]\ncost\n");
  const Sol sol = solve(corner(3.0, false, 13));
  EXPECT_EQ(sol.code(), "510");
  EXPECT_NE(sol.message.find("floor"), std::string::npos) << sol.message;
  EXPECT_NE(sol.message.find("heat[3] (C1)"), std::string::npos) << sol.message;
}

TEST_F(Ampl, ConvertedModelKeepsTheNamesBesideIt) {
  const std::string model = quoted(file("model.nl", corner(21.0))), json = directory_.file("model.json");
  file("model.row", "pairs\nheat[3]\n");
  file("model.col", "gap\nforce\n");
  ASSERT_EQ(run("convert " + model + " " + quoted(json)).exit_code, 0);
  const Json names = Json::parse(read_file(json))["names"];
  EXPECT_EQ(names["variables"], Json({"gap (v0)", "force (v1)"}));
  const auto first_lines = [this](const std::string& path) {
    const std::string out = run("explain --quiet --local " + path).out;
    return out.substr(0, out.find("  time "));
  };
  EXPECT_EQ(first_lines(quoted(json)), first_lines(model));
  EXPECT_NE(first_lines(model).find("heat[3] (C1)"), std::string::npos) << first_lines(model);
}

TEST_F(Ampl, AServerIsAskedWhereOneIsNamed) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--workers", "1"});
  const auto client = Client::connect(server.address()).value();
  const Sol sol = solve(corner(3.0), "", {"MARBLE_SERVER=" + server.address()});
  EXPECT_EQ(sol.code(), "0") << sol.message;
  EXPECT_EQ(client.info().value().answered, 1);
  EXPECT_EQ(solve(corner(3.0), "server=local", {"MARBLE_SERVER=127.0.0.1:1"}).code(), "0");
  const Sol nobody = solve(corner(3.0), "", {"MARBLE_SERVER=127.0.0.1:1"});
  EXPECT_EQ(nobody.code(), "530");
  EXPECT_NE(nobody.message.find("127.0.0.1:1"), std::string::npos) << nobody.message;
}

TEST_F(Ampl, DualValuesOfTheFileAreAWarmStartHereAndOnAServer) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--workers", "1"});
  const auto work_of = [&](const std::string& content, const std::string& where) {
    const Sol sol = solve(content, "server=" + where);
    EXPECT_EQ(sol.code(), "0") << sol.message;
    return sol.message.substr(sol.message.find('\n'));
  };
  std::string solved = corner(3.0);
  solved.insert(solved.find("\nr\n") + 1, "d2\n0 -1\n1 2\nx2\n0 1.5\n1 1.5\n");
  for (const std::string& where : {std::string("local"), server.address()})
    EXPECT_TRUE(work_of(solved, where).starts_with("\n0 iterations, 1 factorizations\n"));
  EXPECT_EQ(work_of(solved, server.address()), work_of(solved, "local"));
}

TEST_F(Ampl, WithoutAmplTheMessageIsPrintedAndTheSolFileHasNoCode) {
  const std::string path = file("model.nl", corner(3.0)), out = file("answer", "");
  const Result result = run("'-o" + out + "' '" + path + "'");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("solved"), std::string::npos);
  const Sol sol = read_sol(out);
  EXPECT_EQ(sol.code(), "none");
  EXPECT_EQ(sol.lines.size(), 13U) << "the answer's last line is the file's";
}

TEST_F(Ampl, VersionAndOptionsAreReported) {
  const Result version = run("-v");
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_TRUE(version.out.starts_with("marble ")) << version.out;
  const Result options = run("-=");
  EXPECT_EQ(options.exit_code, 0);
  for (const char* const name : {"time_limit_s", "global_search", "server", "outlev"})
    EXPECT_NE(options.out.find(name), std::string::npos) << name;
}

TEST_F(Ampl, WithoutAFileToAnswerThereIsAnErrorAndNoSolFile) {
  const Result missing = run("nowhere/model -AMPL");
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_NE(missing.err.find("nowhere/model.nl"), std::string::npos) << missing.err;
  const std::string path = file("other.nl", "{}");
  const Result other = run("'" + path + "' -AMPL");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_NE(other.err.find("not an .nl file"), std::string::npos) << other.err;
  EXPECT_FALSE(std::filesystem::exists(path.substr(0, path.size() - 3) + ".sol"));
  EXPECT_EQ(run("-AMPL").exit_code, 2);
  EXPECT_EQ(run("'" + path + "' -AMPL -x").exit_code, 2);
}

}  // namespace
}  // namespace marble::testing
