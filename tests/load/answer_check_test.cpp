#include "answer_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "marble/convert.h"
#include "marble/solver.h"

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

}  // namespace
}  // namespace marble::load
