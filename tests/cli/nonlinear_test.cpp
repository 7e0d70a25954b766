// Nonlinear .nl files on the command line: what is reported, here and over a server, and what may be set.
#include "cli_test.h"
#include "formats/nl_writer.h"

namespace marble::testing {
namespace {

class NonlinearFile : public Cli {
 protected:
  /// min (x0 - 3)^2 + (x1 - 1)^2  s.t.  0 <= x1 complements x0^2 - 4 x1 >= 0, exp(x0) <= `most`: at
  /// log(most), where that is in [0, 2], x1 is x0^2 / 4. Begins at x0 = `start`, on that branch.
  static std::string valley(double most, double start = 1.0, bool maximum = false, int function = 44) {
    NlWriter nl(false, 2, 2, 1);
    nl.key('C').integer(0).operation(5).variable(0).constant(2.0);
    nl.key('C').integer(1).operation(function).variable(0);
    nl.key('O').integer(0).integer(maximum ? 1 : 0);
    if (maximum) nl.operation(16);
    nl.operation(0).operation(5).operation(1).variable(0).constant(3.0).constant(2.0);
    nl.operation(5).operation(1).variable(1).constant(1.0).constant(2.0);
    nl.key('x').integer(2).entry(0, start).entry(1, start * start / 4.0);
    nl.key('r').complements(1, 1).at_most(most);
    nl.key('b').free().at_least(0.0);
    nl.key('k').integer(1).line().integer(2);
    nl.key('J').integer(0).integer(2).entry(0, 0.0).entry(1, -4.0);
    nl.key('J').integer(1).integer(1).entry(0, 0.0);
    nl.key('G').integer(0).integer(2).entry(0, 0.0).entry(1, 0.0);
    return nl.content();
  }
  std::string path(const std::string& content) { return "'" + file("valley.nl", content) + "'"; }
  Json answer(const std::string& words, int exit_code = 0) {
    const Result result = run("solve --quiet --output json " + words);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    const auto lines = result.lines();
    EXPECT_EQ(lines.size(), 1U) << result.out;
    return lines.empty() ? Json() : lines[0];
  }
};

TEST_F(NonlinearFile, AnAnswerHasStatusNumbersAndWork) {
  for (const bool maximum : {false, true}) {
    const double sign = maximum ? -1.0 : 1.0;
    const Json json = answer("--local " + path(valley(std::exp(1.5), 1.0, maximum)));
    EXPECT_EQ(json["status"], "solved") << json;
    const double x = 1.5, y = x * x / 4.0;
    EXPECT_NEAR(json["objective"].get<double>(), sign * ((x - 3) * (x - 3) + (y - 1) * (y - 1)), 1e-7);
    EXPECT_NEAR(json["x"][0].get<double>(), x, 1e-7);
    EXPECT_NEAR(json["x"][1].get<double>(), y, 1e-7);
    // The pair's multiplier ξ = (y - 1) / 2; with b = exp x, db/dx = b: dual = d objective / d b.
    EXPECT_NEAR(json["duals"][0].get<double>(), sign * -(y - 1) / 2, 1e-6);
    EXPECT_NEAR(json["duals"][1].get<double>(), sign * (2 * (x - 3) + (y - 1) * x) / std::exp(x), 1e-6);
    EXPECT_LE(json["violation"].get<double>(), 1e-6);
    EXPECT_LE(json["kkt_residual"].get<double>(), 1e-6);
    EXPECT_GT(json["ticks"].get<int>(), 1);
    EXPECT_GE(json["factorizations"].get<int>(), json["ticks"].get<int>());
  }
}

TEST_F(NonlinearFile, ARowIsReportedForEachIterationUnlessItIsToBeQuiet) {
  const std::string model = path(valley(3.0));
  const Result reported = run("solve --local " + model), quiet = run("solve --local --quiet " + model);
  EXPECT_EQ(reported.exit_code, 0);
  EXPECT_NE(reported.err.find("violation      step    radius"), std::string::npos) << reported.err;
  EXPECT_NE(reported.err.find("\n    1 "), std::string::npos) << reported.err;
  EXPECT_NE(reported.out.find("valley: solved"), std::string::npos) << reported.out;
  EXPECT_EQ(quiet.err, "");
}

TEST_F(NonlinearFile, AServerGivesTheSameBits) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--workers", "1"});
  const std::string model = path(valley(3.0));
  Json here = answer("--local " + model), there = answer("--server " + server.address() + " " + model);
  for (Json* const json : {&here, &there}) json->erase("total_seconds");
  EXPECT_EQ(here, there);
  EXPECT_EQ(answer("--server 127.0.0.1:1 " + model, 3)["error"]["code"], "unavailable");
}

TEST_F(NonlinearFile, TheDriverAnswersTheSameFromAServer) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--workers", "1"});
  const std::string model = file("valley.nl", valley(3.0)), sol = file("sol", "");
  const auto solve = [&](const std::string& words) {
    EXPECT_EQ(run("'-o" + sol + "' '" + model + "' -AMPL " + words).exit_code, 0);
    return read_file(sol);
  };
  const std::string here = solve("");
  EXPECT_NE(here.find("\nobjno 0 0\n"), std::string::npos) << here;
  EXPECT_EQ(solve("server=" + server.address()), here);
  const std::string nobody = solve("server=127.0.0.1:1");
  EXPECT_NE(nobody.find("\nobjno 0 530\n"), std::string::npos) << nobody;
  EXPECT_NE(nobody.find("(server 127.0.0.1:1)"), std::string::npos) << nobody;
}

TEST_F(NonlinearFile, SettingsAndOptionsOfEachLcqpAreTaken) {
  const std::string model = path(valley(3.0));
  EXPECT_EQ(answer("--local --option iteration_limit=1 " + model, 1)["status"], "iteration_limit");
  EXPECT_EQ(answer("--local --option curvature=bfgs --option step_tolerance=1e-6 " + model)["status"],
            "solved");
  EXPECT_EQ(answer("--local --option path=paper " + model)["status"], "solved");
  EXPECT_EQ(answer("--local --option nonlinear_method=alag " + model)["status"], "solved");
  EXPECT_EQ(answer("--local --time-limit 0 " + model, 1)["status"], "time_limit");
  for (const char* const wrong :
       {"curvature=flat", "step_tolerance=0", "iteration_limit=many", "nonlinear_method=newton"}) {
    const Result result = run(std::string("solve --local --option ") + wrong + " " + model);
    EXPECT_EQ(result.exit_code, 2) << wrong;
    EXPECT_NE(result.err.find("must be"), std::string::npos) << result.err;
  }
  const Result options = run("-=");
  for (const char* const name : {"step_tolerance", "iteration_limit", "curvature", "nonlinear_method"})
    EXPECT_NE(options.out.find(name), std::string::npos) << name;
}

TEST_F(NonlinearFile, WhatCannotBeSaysSo) {
  // cos(x0) <= -2 is nowhere.
  EXPECT_EQ(answer("--local " + path(valley(-2.0, 1.0, false, 46)), 1)["status"], "locally_infeasible");
  // log(x0) at x0 = -1.
  const Json start = answer("--local " + path(valley(3.0, -1.0, false, 43)), 2);
  EXPECT_EQ(start["status"], "error");
  EXPECT_NE(start["error"]["message"].get<std::string>().find("initial point, in constraint C1"),
            std::string::npos)
      << start;
  const Result trace = run("solve --local --quiet --trace trace.csv " + path(valley(3.0)));
  EXPECT_EQ(trace.exit_code, 2);
  EXPECT_NE(trace.err.find("--trace"), std::string::npos) << trace.err;
}

TEST_F(NonlinearFile, BrokenFilesAreRefusedByTheProgramToo) {
  const std::string whole = valley(3.0);
  for (const std::size_t length :
       {std::size_t{40}, whole.find("\nr\n"), whole.find("\nJ1"), whole.size() - 4}) {
    const Result result = run("solve --local --quiet " + path(whole.substr(0, length)));
    EXPECT_EQ(result.exit_code, 2) << length;
    EXPECT_TRUE(result.err.starts_with("marble: ")) << result.err;
  }
}

}  // namespace
}  // namespace marble::testing
