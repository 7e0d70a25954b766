// marble-load against a real server: what it reports is what happened.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "marble/client.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using Json = nlohmann::json;

struct Outcome {
  int exit_code = 0;
  std::string output;
  [[nodiscard]] Json json() const { return Json::parse(output); }
};

class LoadRun {
 public:
  explicit LoadRun(std::vector<std::string> arguments)
      : process_(with_program(std::move(arguments)), directory_.file("output")) {}
  Outcome wait() {
    const int code = process_.wait();
    return {code, process_.output()};
  }
  void interrupt() { process_.send(SIGINT); }

 private:
  static std::vector<std::string> with_program(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), MARBLE_LOAD_BINARY);
    return arguments;
  }
  TemporaryDirectory directory_;
  ChildProcess process_;
};

Outcome load(std::vector<std::string> arguments) { return LoadRun(std::move(arguments)).wait(); }

class Load : public ::testing::Test {
 protected:
  std::vector<std::string> arguments(std::vector<std::string> first) {
    first.insert(first.end(), {"--server", server_.address(), "--quiet", "--json"});
    return first;
  }
  ServerInfo info() { return Client::connect(server_.address())->info().value(); }
  ServerProcess server_{MARBLE_SERVER_BINARY, {"--workers", "2"}};
};

TEST_F(Load, CountsAreThoseOfTheServerInEveryModeAndBothLoops) {
  std::int64_t answered = 0, updates = 0;
  for (const std::string mode : {"unary", "streamed", "session", "batch"}) {
    for (const std::string loop : {"closed", "open"}) {
      std::vector<std::string> line = {loop,        "--mode",  mode,        "--problem", "jr1",
                                       "--clients", "3",       "--warm-up", "0",         "--count",
                                       "60",        "--check", "1"};
      if (loop == "open") line.insert(line.end(), {"--rate", "300"});
      const Outcome outcome = load(arguments(line));
      ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
      const Json run = outcome.json().at("run");
      EXPECT_EQ(run.at("sent"), 60) << mode << loop;
      EXPECT_EQ(run.at("total").at("answers"), 60) << mode << loop;
      EXPECT_EQ(run.at("total").at("statuses").at("solved"), 60) << mode << loop;
      EXPECT_EQ(run.at("total").at("latency").at("count"), 60) << mode << loop;
      EXPECT_EQ(run.at("checked"), 60) << mode << loop;
      EXPECT_EQ(run.at("wrong"), 0) << mode << loop;
      EXPECT_EQ(run.at("total").at("progress_rows") > 0, mode == "streamed") << mode << loop;
      (mode == "session" ? updates : answered) += 60;
    }
  }
  EXPECT_EQ(info().answered, answered);
  EXPECT_EQ(info().updates, updates);
  EXPECT_EQ(info().refused, 0);
}

TEST_F(Load, AMixIsSentByItsWeightsAndReportedByItsNames) {
  const TemporaryDirectory folder;
  std::ofstream(folder.file("mix.toml")) << R"(
    [[entry]]
    problem = "jr1"
    weight = 3
    [[entry]]
    name = "planner"
    problem = "hopper"
    size = 2
    variants = 4
    mode = "session"
    priority = "realtime"
  )";
  const Outcome outcome = load(arguments({"closed", "--scenario", folder.file("mix.toml"), "--clients", "2",
                                          "--warm-up", "0", "--count", "400", "--check", "1"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const Json run = outcome.json().at("run");
  const int jr1 = run.at("entries").at("jr1").at("answers"),
            planner = run.at("entries").at("planner").at("answers");
  EXPECT_EQ(jr1 + planner, 400);
  EXPECT_NEAR(jr1, 300, 45);  // five deviations of the binomial distribution
  EXPECT_EQ(info().updates, planner);
}

// A server that stands still for two seconds delays all requests that were due in them. Of these a closed
// loop sees as many as it has clients, an open loop all: that is what its latency from the intended time is
// for.
TEST_F(Load, AnOpenLoopSeesEveryRequestThatAStallDelayed) {
  LoadRun run(arguments({"open", "--problem", "jr1", "--rate", "100", "--arrivals", "fixed", "--warm-up", "0",
                         "--duration", "8", "--clients", "1"}));
  ASSERT_TRUE(eventually([&] { return info().answered >= 50; }));
  server_.send(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::seconds(2));
  server_.send(SIGCONT);
  const Outcome outcome = run.wait();
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const Json latency = outcome.json().at("run").at("total").at("latency");
  EXPECT_EQ(latency.at("count"), 799);  // none was left out: 100 a second, from the first gap on
  EXPECT_GE(latency.at("p99_s"), 1.8);
  EXPECT_GE(latency.at("p90_s"), 0.5);  // a quarter of the run's requests were due in the stall
}

TEST_F(Load, RefusalsAreErrorsByCodeWithTheirRetryInfo) {
  ServerProcess small(MARBLE_SERVER_BINARY, {"--workers", "1", "--queue-jobs", "1"});
  std::vector<std::string> line = {"open",   "--server", small.address(), "--quiet",   "--json", "--problem",
                                   "hopper", "--rate",   "400",           "--warm-up", "0",      "--count",
                                   "200"};
  const Outcome outcome = load(line);
  EXPECT_EQ(outcome.exit_code, 1) << outcome.output;
  const Json run = outcome.json().at("run");
  const int refused = run.at("total").at("errors").at("resource_exhausted");
  EXPECT_EQ(refused + run.at("total").at("answers").get<int>(), 200);
  EXPECT_EQ(run.at("total").at("errors_with_retry_info"), refused);
  EXPECT_EQ(run.at("total").at("errors_after").at("count"), refused);
  EXPECT_EQ(Client::connect(small.address())->info()->refused, refused);
  line.insert(line.end(), {"--allow", "resource_exhausted"});
  EXPECT_EQ(load(line).exit_code, 0);
}

TEST_F(Load, ARampFindsARateBetweenOneThatHoldsAndOneThatDoesNot) {
  // One worker that needs a time for each solve: somewhere between 1 and 100000 a second it cannot hold 20
  // ms.
  ServerProcess one(MARBLE_SERVER_BINARY, {"--workers", "1"});
  const TemporaryDirectory folder;
  const Outcome outcome = load({"ramp",        "--server",    one.address(),
                                "--quiet",     "--json",      "--problem",
                                "hopper",      "--size",      "10",
                                "--objective", "p90=200ms",   "--rate",
                                "20",          "--warm-up",   "0.1",
                                "--duration",  "0.5",         "--precision",
                                "0.5",         "--json-file", folder.file("ramp.json")});
  ASSERT_THAT(outcome.exit_code, AnyOf(0, 1)) << outcome.output;
  const Json json = outcome.json();
  EXPECT_EQ(json.at("kind"), "ramp");
  const double best = json.at("best_rate_per_s");
  double least_failing = 1e9;
  for (const Json& step : json.at("steps")) {
    EXPECT_EQ(step.at("holds").get<bool>(), step.at("why_not") == "");
    EXPECT_EQ(step.at("latency_s"), step.at("run").at("total").at("latency").at("p90_s"));
    if (!step.at("holds").get<bool>())
      least_failing = std::min(least_failing, step.at("rate_per_s").get<double>());
  }
  EXPECT_LT(best, least_failing);
  EXPECT_EQ(read_file(folder.file("ramp.json")), outcome.output);
}

TEST_F(Load, OverloadMeasuresTheCapacityAndWhatArrivesInTimeBeyondIt) {
  ServerProcess one(MARBLE_SERVER_BINARY, {"--workers", "1", "--client-queued", "0"});
  const TemporaryDirectory folder;
  const Outcome outcome = load({"overload",   "--server",   one.address(),
                                "--quiet",    "--json",     "--problem",
                                "hopper",     "--size",     "10",
                                "--deadline", "5",          "--levels",
                                "0.5,3",      "--warm-up",  "0.1",
                                "--check",    "1",          "--duration",
                                "1",          "--csv-file", folder.file("table.csv")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const Json json = outcome.json();
  EXPECT_EQ(json.at("kind"), "overload");
  EXPECT_GT(json.at("capacity_per_s").get<double>(), 0.0);
  ASSERT_EQ(json.at("steps").size(), 2U);
  for (const Json& step : json.at("steps")) {
    EXPECT_GT(step.at("goodput").get<double>(), 0.0);
    EXPECT_GT(step.at("useful").get<double>(), 0.0);
    EXPECT_EQ(step.at("run").at("wrong"), 0);
  }
  const std::string table = read_file(folder.file("table.csv"));
  EXPECT_THAT(table,
              StartsWith("level,offered_per_s,answers_per_s,goodput,useful,p50_s,p99_s,sent,refused,late,"));
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 3);
}

TEST_F(Load, JsonHasEveryKeyThatItsSchemaPromises) {
  const Json json =
      load(arguments({"open", "--problem", "jr1", "--rate", "200", "--warm-up", "0.1", "--duration", "1.2"}))
          .json();
  EXPECT_EQ(json.at("schema"), "marble-load/1");
  for (const char* key : {"kind", "command", "server", "machine", "run"})
    EXPECT_TRUE(json.contains(key)) << key;
  const Json& run = json.at("run");
  for (const char* key : {"plan",
                          "ending",
                          "measured_s",
                          "sent",
                          "answers_per_s",
                          "answers_while_measured",
                          "errors_while_measured",
                          "abandoned",
                          "checked",
                          "check_let_go",
                          "wrong",
                          "first_fault",
                          "server_cpu_s",
                          "server_cpu_per_answer_s",
                          "load_cpu_s",
                          "load_cpu_per_answer_s",
                          "lagged",
                          "in_flight_limit_reached",
                          "lag",
                          "total",
                          "entries",
                          "error_messages",
                          "server_counters",
                          "seconds"})
    EXPECT_TRUE(run.contains(key)) << key;
  for (const char* key : {"answers", "statuses", "errors", "errors_with_retry_info", "latency", "service",
                          "server_queue", "server_solve", "outside_server", "errors_after"})
    EXPECT_TRUE(run.at("total").contains(key)) << key;
  for (const char* key : {"count", "mean_s", "least_s", "p50_s", "p75_s", "p90_s", "p95_s", "p99_s",
                          "p99.9_s", "p99.99_s", "most_s"})
    EXPECT_TRUE(run.at("total").at("latency").contains(key)) << key;
  ASSERT_FALSE(run.at("seconds").empty());
  EXPECT_GT(run.at("seconds").at(0).at("resident_bytes"), 0);
  EXPECT_GT(run.at("server_cpu_s"), 0.0);
  EXPECT_GT(run.at("load_cpu_s"), 0.0);
}

// The points of a plot: the last is the slowest of all answers.
TEST_F(Load, CumulativeDistributionsAscendToAllAnswersAndAreThin) {
  const Outcome outcome =
      load(arguments({"closed", "--problem", "jr1", "--clients", "2", "--warm-up", "0", "--count", "3000"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const Json total = outcome.json().at("run").at("total");
  for (const char* name : {"latency", "server_queue", "server_solve", "outside_server"}) {
    const Json& distribution = total.at(name);
    const Json& points = distribution.at("cumulative");
    ASSERT_FALSE(points.empty()) << name;
    EXPECT_LE(points.size(), 200U) << name;  // 50 for each of the 3.5 nines of 3000
    for (std::size_t i = 1; i < points.size(); ++i) {
      EXPECT_LT(points[i - 1][0], points[i][0]) << name;
      EXPECT_LT(points[i - 1][1], points[i][1]) << name;
    }
    EXPECT_EQ(points.back()[0], distribution.at("most_s")) << name;
    EXPECT_EQ(points.back()[1], 1.0) << name;
  }
  EXPECT_GE(total.at("latency").at("cumulative").size(), 20U);
}

TEST_F(Load, AnInterruptEndsEarlyWithTheReportSoFar) {
  LoadRun run(
      arguments({"open", "--problem", "jr1", "--rate", "100", "--warm-up", "0", "--duration", "600"}));
  ASSERT_TRUE(eventually([&] { return info().answered >= 20; }));
  run.interrupt();
  const Outcome outcome = run.wait();
  EXPECT_THAT(outcome.exit_code, AnyOf(0, 1)) << outcome.output;  // 1: what was under way was given up
  const Json json = outcome.json();
  EXPECT_EQ(json.at("run").at("ending"), "interrupted");
  EXPECT_GE(json.at("run").at("total").at("answers"), 20);
}

TEST_F(Load, AnUnreachableServerAndARefusedSessionHaveAnExitCodeOfTheirOwn) {
  const Outcome away = load({"closed", "--server", "unix:/nowhere/marble.sock", "--count", "1"});
  EXPECT_EQ(away.exit_code, 3);
  EXPECT_THAT(away.output, HasSubstr("marble-load: "));
  ServerProcess none(MARBLE_SERVER_BINARY, {"--sessions", "1"});
  const Outcome refused =
      load({"closed", "--server", none.address(), "--mode", "session", "--clients", "2", "--count", "1"});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.output, HasSubstr("a session was not set up: resource_exhausted"));
}

TEST_F(Load, BadInputIsReportedBeforeAnythingIsSent) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"closed", "--problem", "no-such-file.json"}, "no-such-file.json"},
      {{"closed", "--mode", "sessions"}, "--mode"},
      {{"open"}, "--rate is required"},
      {{"ramp", "--objective", "p99"}, "must be pQ=TIME"},
      {{"closed", "--option", "kappa=1"}, "kappa"},
      {{"closed", "--scenario", "no/mix.toml"}, "no/mix.toml: cannot be read"},
      {{"closed", "--server", "nowhere"}, "host:port"}};
  for (const auto& [line, text] : cases) {
    const Outcome outcome = load(line);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
    EXPECT_THAT(outcome.output, HasSubstr(text));
  }
  EXPECT_EQ(info().accepted, 0);
}

}  // namespace
}  // namespace marble::testing
