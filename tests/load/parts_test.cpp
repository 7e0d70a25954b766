#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <thread>
#include <vector>

#include "answer_check.h"
#include "arrivals.h"
#include "histogram.h"
#include "marble/client.h"
#include "marble/convert.h"
#include "marble/solver.h"
#include "objective.h"
#include "scenario.h"
#include "support/server_process.h"

namespace marble::load {
namespace {

using ::testing::HasSubstr;

struct Case {
  OwnedProblem problem;
  Solution answer;
};

Case solved(const char* name) {
  Entry entry = single_entry(name);
  entry.size = entry.problem == "hopper" ? 5 : 0;
  OwnedProblem problem = problems_of(entry).value().front();
  Solution answer = solve_in_process(problem.view()).value();
  return {std::move(problem), std::move(answer)};
}

std::string fault(const Case& c) { return fault_of(c.problem, {}, c.answer).value_or(""); }

TEST(AnswerCheck, TheSolversAnswersAreRight) {
  for (const char* name : {"jr1", "hopper", "rocket", "gates"}) EXPECT_EQ(fault(solved(name)), "") << name;
}

TEST(AnswerCheck, AnAnswerThatBreaksAConstraintIsWrong) {
  Case c = solved("hopper");
  c.answer.z[0] += 1e-3;
  EXPECT_NE(fault(c), "");
}

TEST(AnswerCheck, AnAnswerWithBothSidesOfAPairOpenIsWrong) {
  Case c = solved("jr1");
  c.answer.z = {0.0, 1.0};
  c.answer.objective = 2.0;
  EXPECT_THAT(fault(c), HasSubstr("complementarity violated by 1"));
}

TEST(AnswerCheck, AnObjectiveThatIsNotThatOfThePointIsWrong) {
  Case c = solved("rocket");
  c.answer.objective *= 1.0 + 1e-6;
  EXPECT_THAT(fault(c), HasSubstr("objective off by"));
}

TEST(AnswerCheck, AFeasiblePointThatIsNotStationaryIsWrong) {
  Case c = solved("jr1");
  c.answer.z = {-1.0, 0.0};  // s = 0, t = 1: feasible, far from the optimum
  c.answer.objective = 4.0;
  EXPECT_THAT(fault(c), HasSubstr("not stationary"));
}

TEST(AnswerCheck, AnAnswerOfAnotherSizeIsWrong) {
  Case c = solved("jr1");
  c.answer.z.push_back(0.0);
  EXPECT_THAT(fault(c), HasSubstr("sizes"));
}

TEST(AnswerCheck, NumbersThatAreNoneAreWrong) {
  Case c = solved("jr1");
  c.answer.z[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(fault(c), "");
}

TEST(AnswerCheck, AnAnswerThatDoesNotClaimToBeSolvedMayViolateButNotLie) {
  Case c = solved("jr1");
  c.answer.status = Status::time_limit;
  c.answer.z = {0.0, 1.0};
  c.answer.objective = 2.0;
  EXPECT_EQ(fault(c), "");
  c.answer.objective = 1.0;
  EXPECT_THAT(fault(c), HasSubstr("objective"));
}

TEST(AnswerCheck, CountsWhatItCheckedAndWhatWasWrong) {
  const auto entries = load(Scenario{{single_entry("jr1")}}, Mode::unary).value();
  Case c = solved("jr1");
  AnswerCheck check(entries);
  for (int i = 0; i < 3; ++i) {
    v1::Solution answer;
    to_message(c.answer, &answer);
    if (i == 1) answer.set_objective(7.0);
    check.add(Work{}, std::move(answer));
  }
  const AnswerCheck::Findings findings = check.finish();
  EXPECT_EQ(findings.checked, 3u);
  EXPECT_EQ(findings.wrong_count(), 1u);
  EXPECT_THAT(findings.first_fault, HasSubstr("jr1: objective off by"));
}

constexpr int kArrivals = 100'000;
constexpr double kRate = 250.0;

std::vector<double> gaps_s(ArrivalProcess process, std::uint64_t seed) {
  Arrivals arrivals(process, kRate, seed);
  std::vector<double> gaps;
  double before = 0.0;
  for (int i = 0; i < kArrivals; ++i) {
    const double at = std::chrono::duration<double>(arrivals.next()).count();
    gaps.push_back(at - before);
    before = at;
  }
  return gaps;
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

TEST(Arrivals, FixedOnesComeAtEvenTimesAndDoNotDrift) {
  Arrivals arrivals(ArrivalProcess::fixed, 3.0, 1);
  for (std::int64_t i = 1; i <= 3'000'000; ++i) {
    const auto at = arrivals.next();
    if (i % 3 == 0) {
      ASSERT_EQ(at, std::chrono::seconds(i / 3));
    }
  }
}

TEST(Arrivals, PoissonOnesHaveTheRate) {
  // The mean of N exponential gaps has the relative deviation 1/sqrt(N): five of them.
  EXPECT_NEAR(mean(gaps_s(ArrivalProcess::poisson, 1)) * kRate, 1.0, 5.0 / std::sqrt(kArrivals));
}

TEST(Arrivals, PoissonGapsAreExponential) {
  auto gaps = gaps_s(ArrivalProcess::poisson, 2);
  std::sort(gaps.begin(), gaps.end());
  double distance = 0.0;  // of Kolmogorov and Smirnov
  for (std::size_t i = 0; i < gaps.size(); ++i) {
    const double part = 1.0 - std::exp(-kRate * gaps[i]);
    distance = std::max({distance, std::abs(part - static_cast<double>(i) / kArrivals),
                         std::abs(part - static_cast<double>(i + 1) / kArrivals)});
  }
  EXPECT_LT(distance, 1.95 / std::sqrt(kArrivals));  // exceeded by one true sample in a thousand
}

TEST(Arrivals, PoissonGapsDoNotRememberEachOther) {
  const auto gaps = gaps_s(ArrivalProcess::poisson, 3);
  const double average = mean(gaps);
  double together = 0.0, alone = 0.0;
  for (std::size_t i = 1; i < gaps.size(); ++i) {
    together += (gaps[i] - average) * (gaps[i - 1] - average);
    alone += (gaps[i] - average) * (gaps[i] - average);
  }
  EXPECT_LT(std::abs(together / alone), 5.0 / std::sqrt(kArrivals));
}

TEST(Arrivals, ASeedGivesTheSameAgainAndAnotherOneOthers) {
  EXPECT_EQ(gaps_s(ArrivalProcess::poisson, 4), gaps_s(ArrivalProcess::poisson, 4));
  EXPECT_NE(gaps_s(ArrivalProcess::poisson, 4), gaps_s(ArrivalProcess::poisson, 5));
}

}  // namespace
}  // namespace marble::load

namespace marble::testing {
namespace {

// What a load tester asks of its connections: one each, and failures as they are.
OwnedProblem problem_of(const char* name) {
  return load::problems_of(load::single_entry(name)).value().front();
}

// Where the requests in the log came from: host and port.
std::set<std::string> peers(const ServerProcess& server) {
  std::set<std::string> result;
  for (const std::string& line : server.log_lines({"component=job"})) {
    const std::size_t begin = line.find("peer=");
    result.insert(line.substr(begin, line.find(' ', begin) - begin));
  }
  return result;
}

std::size_t peers_of_three_clients(bool own_connection) {
  ServerProcess server(MARBLE_SERVER_BINARY);
  ConnectOptions options;
  options.own_connection = own_connection;
  const OwnedProblem problem = problem_of("jr1");
  std::vector<Client> clients;
  for (int i = 0; i < 3; ++i) {
    clients.push_back(Client::connect(server.address(), options).value());
    EXPECT_TRUE(clients.back().solve(problem.view()));
  }
  server.terminate();
  EXPECT_EQ(server.wait(), 0);  // then all is logged
  return peers(server).size();
}

TEST(Connection, ClientsThatAskForItHaveOneEach) {
  EXPECT_EQ(peers_of_three_clients(true), 3U);
  EXPECT_EQ(peers_of_three_clients(false), 1U);
}

// A server that drains refuses with `unavailable`, which clients repeat elsewhere unless it says otherwise.
std::size_t refusals_of_one_call(bool retries) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--drain-grace-s", "3600"});
  ConnectOptions options;
  options.retries = retries;
  const Client client = Client::connect(server.address(), options).value();
  Options endless;
  endless.max_iterations = 1'000'000'000;
  endless.path = Path::paper;
  endless.complementarity_tolerance = endless.equality_tolerance = endless.stationarity_tolerance = 1e-14;
  const OwnedProblem large = problem_of("hopper");
  auto pending = client.solve_async(large.view(), endless).value();
  EXPECT_TRUE(eventually([&] { return client.info()->running == 1; }));
  server.terminate();
  EXPECT_TRUE(eventually([&] { return !client.healthy().value_or(false); }));
  const OwnedProblem tiny = problem_of("jr1");
  const auto answer = client.solve(tiny.view());
  EXPECT_FALSE(answer);
  if (!answer) {
    EXPECT_EQ(answer.error().code, ErrorCode::unavailable);
  }
  pending.cancel();
  EXPECT_EQ(server.wait(), 0);  // then all is logged
  return server.log_lines({"refused", "unavailable"}).size();
}

TEST(Connection, WithoutRetriesAFailureIsOneFailure) {
  EXPECT_EQ(refusals_of_one_call(false), 1U);
  EXPECT_GT(refusals_of_one_call(true), 1U);
}

}  // namespace
}  // namespace marble::testing

namespace marble::load {
namespace {

// The same definition by sorting: the smallest value that this part of all does not exceed.
std::int64_t exact_quantile(std::vector<std::int64_t> values, double part) {
  std::sort(values.begin(), values.end());
  const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(values.size())));
  return values[std::max<std::size_t>(rank, 1) - 1];
}

void expect_three_digits(std::int64_t found, std::int64_t exact) {
  EXPECT_GE(found, exact);
  EXPECT_LE(static_cast<double>(found), 1.001 * static_cast<double>(exact));
}

// Values over many powers of ten, as latencies are.
std::vector<std::int64_t> random_values(std::mt19937_64& engine, std::size_t count) {
  std::vector<std::int64_t> values;
  const double most = 1.0 + 11.0 * uniform(engine);
  for (std::size_t i = 0; i < count; ++i)
    values.push_back(static_cast<std::int64_t>(std::pow(10.0, most * uniform(engine))));
  return values;
}

TEST(Histogram, QuantilesAreWithinAThousandthAboveThoseOfTheSortedValues) {
  std::mt19937_64 engine(7);
  for (int round = 0; round < 50; ++round) {
    const auto values = random_values(engine, 1 + static_cast<std::size_t>(2000.0 * uniform(engine)));
    Histogram histogram;
    for (const std::int64_t value : values) histogram.add(value);
    for (const double part : {0.0, 0.001, 0.25, 0.5, 0.75, 0.9, 0.99, 0.999, 0.9999, 1.0})
      expect_three_digits(histogram.quantile(part), exact_quantile(values, part));
  }
}

TEST(Histogram, LeastMostAndMeanAreExact) {
  Histogram histogram;
  for (const std::int64_t value : std::vector<std::int64_t>{1'234'567'891, 3, 987'654'321'012})
    histogram.add(value);
  EXPECT_EQ(histogram.least(), 3);
  EXPECT_EQ(histogram.most(), 987'654'321'012);
  EXPECT_EQ(histogram.quantile(1.0), 987'654'321'012);
  EXPECT_DOUBLE_EQ(histogram.mean(), (1'234'567'891.0 + 3.0 + 987'654'321'012.0) / 3.0);
}

TEST(Histogram, MergedPartsAreTheWhole) {
  std::mt19937_64 engine(8);
  const auto values = random_values(engine, 5000);
  Histogram whole, merged, parts[3];
  for (std::size_t i = 0; i < values.size(); ++i) {
    whole.add(values[i]);
    parts[i % 3].add(values[i]);
  }
  for (const Histogram& part : parts) merged.merge(part);
  EXPECT_EQ(merged.count(), whole.count());
  EXPECT_EQ(merged.least(), whole.least());
  EXPECT_EQ(merged.most(), whole.most());
  for (double part = 0.0; part <= 1.0; part += 0.01) EXPECT_EQ(merged.quantile(part), whole.quantile(part));
}

TEST(Histogram, OfNoValuesSaysZero) {
  Histogram histogram;
  EXPECT_EQ(histogram.quantile(0.99), 0);
  EXPECT_EQ(histogram.mean(), 0.0);
  histogram.add(5);
  histogram.clear();
  EXPECT_EQ(histogram.count(), 0u);
  EXPECT_EQ(histogram.most(), 0);
  EXPECT_TRUE(histogram.steps().empty());
}

TEST(Histogram, TakesTheEndsOfItsRange) {
  Histogram histogram;
  histogram.add(-5);
  histogram.add(std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(histogram.quantile(0.5), 0);
  EXPECT_EQ(histogram.quantile(1.0), std::numeric_limits<std::int64_t>::max());
}

TEST(Histogram, StepsAscendToTheWhole) {
  std::mt19937_64 engine(9);
  Histogram histogram;
  for (const std::int64_t value : random_values(engine, 1000)) histogram.add(value);
  const auto steps = histogram.steps();
  for (std::size_t i = 1; i < steps.size(); ++i) {
    EXPECT_GT(steps[i].value, steps[i - 1].value);
    EXPECT_GT(steps[i].part, steps[i - 1].part);
  }
  EXPECT_DOUBLE_EQ(steps.back().part, 1.0);
}

std::string error_of(const std::string& text) {
  const auto scenario = parse_scenario(text, "mix.toml");
  return scenario ? "" : scenario.error().message();
}

TEST(Scenario, EveryKeyOfAnEntryIsRead) {
  const auto scenario = parse_scenario(R"(
    [[entry]]
    name = "planner"
    problem = "hopper"
    size = 10
    variants = 4
    weight = 3
    mode = "session"
    priority = "realtime"
    deadline_s = 0.5
    cold = true
    progress_interval_s = 0.01
    options = { time_limit_s = 2, path = "paper", polish = false }

    [[entry]]
    file = "data/rocket.json"
  )",
                                       "folder/mix.toml");
  ASSERT_TRUE(scenario) << scenario.error().message();
  ASSERT_EQ(scenario->entries.size(), 2u);
  const Entry& first = scenario->entries[0];
  EXPECT_EQ(first.name, "planner");
  EXPECT_EQ(first.problem, "hopper");
  EXPECT_EQ(first.size, 10);
  EXPECT_EQ(first.variants, 4);
  EXPECT_EQ(first.weight, 3.0);
  EXPECT_EQ(first.mode, Mode::session);
  EXPECT_EQ(first.priority, Priority::realtime);
  EXPECT_EQ(first.deadline_s, 0.5);
  EXPECT_TRUE(first.cold);
  EXPECT_EQ(first.progress_interval_s, 0.01);
  EXPECT_EQ(first.options.time_limit_s, 2.0);
  EXPECT_EQ(first.options.path, Path::paper);
  EXPECT_FALSE(first.options.polish);
  EXPECT_EQ(scenario->entries[1].name, "rocket");
  EXPECT_EQ(scenario->entries[1].file, "folder/data/rocket.json");
  EXPECT_EQ(scenario->entries[1].mode, std::nullopt);
}

TEST(Scenario, AFaultIsReportedWithFileLineKeyValueAndRule) {
  EXPECT_EQ(error_of("[[entry]]\nproblem = 'hopper'\nweight = -1\n"),
            "mix.toml:3: weight = -1: must be a number in [1e-06, 1e+06]");
  EXPECT_EQ(error_of("[[entry]]\nproblem = 'hoper'\n"),
            "mix.toml:2: problem = hoper: must be hopper, rocket, gates, qpec or jr1");
  EXPECT_EQ(error_of("[[entry]]\nproblem = 'hopper'\nmode = 'stream'\n"),
            "mix.toml:3: mode = stream: must be unary, streamed, session or batch");
  EXPECT_EQ(error_of("[[entry]]\nproblem = 'hopper'\nsize = 1.5\n"),
            "mix.toml:3: size = 1.5: must be a whole number in [1, 100000]");
  EXPECT_EQ(error_of("[[entry]]\nproblem = 'hopper'\ncold = 1\n"),
            "mix.toml:3: cold = 1: must be true or false");
  EXPECT_EQ(error_of("[[entry]]\nproblem = 'hopper'\nweihgt = 1\n"),
            "mix.toml:3: weihgt: is no key of an entry");
  EXPECT_EQ(error_of("[[entries]]\nproblem = 'hopper'\n"),
            "mix.toml:1: entries: is no key of a scenario; it has [[entry]] tables");
}

TEST(Scenario, WhatIsNotTomlIsReportedWithItsLine) {
  EXPECT_EQ(error_of("[[entry]]\nproblem = \n").rfind("mix.toml:2", 0), 0u)
      << error_of("[[entry]]\nproblem = \n");
}

TEST(Scenario, WhatTomlPlusPlusTakesForGrantedIsReportedToo) {
  // Undefined behaviour in toml++ 3.3 as it comes: see guarded_toml.h.
  EXPECT_EQ(error_of("[=w").rfind("mix.toml:1", 0), 0u) << error_of("[=w");
  const std::string letters = "[[entry]]\nproblem = 'jr1'\n\xc3\xa9 = 1\n";
  EXPECT_EQ(error_of(letters).rfind("mix.toml:3", 0), 0u) << error_of(letters);
  EXPECT_EQ(error_of("[[\xef\xbb\xbe]]").rfind("mix.toml:1", 0), 0u);
}

TEST(Scenario, AnEntryHasEitherAProblemOrAFile) {
  EXPECT_EQ(error_of("[[entry]]\nweight = 1\n"), "mix.toml:1: entry: must have either problem or file");
  EXPECT_EQ(error_of("[[entry]]\nproblem = 'jr1'\nfile = 'a.json'\n"),
            "mix.toml:1: entry: must have either problem or file");
  EXPECT_EQ(error_of(""), "mix.toml: entry: there must be at least one [[entry]]");
}

TEST(Scenario, NamesReportEntriesApart) {
  const std::string twice = "[[entry]]\nproblem = 'jr1'\n[[entry]]\nproblem = 'jr1'\n";
  EXPECT_EQ(error_of(twice), "mix.toml:3: name = jr1: another entry has this name: give each its own");
}

TEST(Scenario, ASolverOptionHasTheSolversOwnRule) {
  EXPECT_EQ(
      error_of("[[entry]]\nproblem = 'jr1'\noptions = { kappa = 1 }\n").rfind("mix.toml:3: options.kappa", 0),
      0u);
  const std::string beyond = error_of("[[entry]]\nproblem = 'jr1'\noptions = { kappa_min = 7 }\n");
  EXPECT_NE(beyond.find("options.kappa_min = 7"), std::string::npos) << beyond;
}

TEST(Scenario, AMissingFileIsReportedByItsName) {
  const auto scenario = read_scenario("no/such/mix.toml");
  ASSERT_FALSE(scenario);
  EXPECT_EQ(scenario.error().code, ErrorCode::not_found);
  EXPECT_EQ(scenario.error().message(), "no/such/mix.toml: cannot be read");
}

TEST(Scenario, EveryExampleGivesItsVariantsInOnePattern) {
  for (const std::string& name : example_names()) {
    Entry entry = single_entry(name);
    entry.variants = 3;
    const auto problems = problems_of(entry);
    ASSERT_TRUE(problems) << name << ": " << problems.error().message();
    EXPECT_EQ(problems->size(), 3u);
  }
}

TEST(Objective, IsAPartAndATimeWithItsUnit) {
  const auto objective = parse_objective("p99.9=50ms");
  ASSERT_TRUE(objective);
  EXPECT_DOUBLE_EQ(objective->part, 0.999);
  EXPECT_DOUBLE_EQ(objective->most_s, 0.05);
  EXPECT_DOUBLE_EQ(parse_objective("p50=800us")->most_s, 8e-4);
  EXPECT_DOUBLE_EQ(parse_objective("p100=2s")->part, 1.0);
  for (const char* wrong :
       {"", "p99", "99=5ms", "p0=5ms", "p101=5ms", "p99=5", "p99=-5ms", "p99=5m", "p=5ms"})
    EXPECT_FALSE(parse_objective(wrong)) << wrong;
}

}  // namespace
}  // namespace marble::load
