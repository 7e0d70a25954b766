#include "scenario.h"

#include <gtest/gtest.h>

#include "objective.h"

namespace marble::load {
namespace {

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
