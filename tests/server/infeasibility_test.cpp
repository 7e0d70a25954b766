#include "jobs/infeasibility.h"

#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "service/job_message.h"

namespace marble::server {
namespace {

Solution infeasible(std::vector<double> certificate) {
  Solution solution;
  solution.status = Status::infeasible;
  solution.certificate = std::move(certificate);
  return solution;
}

std::vector<Index> rows_of(const Infeasibility& why) {
  std::vector<Index> rows;
  for (const auto& [row, multiplier] : why.rows) rows.push_back(row);
  return rows;
}

TEST(Infeasibility, KeepsTheRowsWithTheLargestMultipliersInTheirOrder) {
  const auto why = infeasibility_of(infeasible({0.0, -3.0, 1e-9, 5.0, 3.0}), 5);
  ASSERT_NE(why, nullptr);
  EXPECT_EQ(rows_of(*why), (std::vector<Index>{3, 1, 4}));
  EXPECT_EQ(why->rows[1].multiplier, -3.0);
  EXPECT_EQ(why->more_rows, 0);
  EXPECT_FALSE(why->conflict);
}

TEST(Infeasibility, CountsTheRowsThatItDoesNotKeep) {
  std::vector<double> certificate(1000);
  std::iota(certificate.begin(), certificate.end(), 1.0);
  const auto why = infeasibility_of(infeasible(certificate), certificate.size());
  EXPECT_EQ(rows_of(*why), (std::vector<Index>{999, 998, 997, 996, 995, 994, 993, 992}));
  EXPECT_EQ(why->more_rows, 1000 - 8 - 1) << "the first one is negligible";
}

TEST(Infeasibility, IgnoresACertificateOfAnotherSizeAndNumbersThatAreNone) {
  EXPECT_TRUE(infeasibility_of(infeasible({1.0, 2.0}), 3)->rows.empty());
  EXPECT_TRUE(infeasibility_of(infeasible({}), 0)->rows.empty());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(rows_of(*infeasibility_of(infeasible({nan, 1.0, nan}), 3)), std::vector<Index>{1});
}

TEST(Infeasibility, ShortensALongConflictInTheOrderOfItsParts) {
  Solution solution = infeasible({});
  Conflict conflict;
  for (Index row = 0; row < 70; ++row) {
    conflict.equalities.push_back(row);
    conflict.right_sides.push_back(row);
  }
  conflict.complementarities = {1};
  conflict.detail = "why";
  solution.conflict = conflict;
  const auto why = infeasibility_of(solution, 0);
  EXPECT_EQ(why->conflict->equalities.size(), 70U);
  EXPECT_EQ(why->conflict->right_sides.size(), 30U);
  EXPECT_TRUE(why->conflict->complementarities.empty());
  EXPECT_EQ(why->more_parts, 41);
  EXPECT_EQ(why->conflict->detail, "why");
}

TEST(Infeasibility, OtherStatusesHaveNone) {
  Solution solution = infeasible({1.0});
  for (const Status status : {Status::solved, Status::unbounded, Status::locally_infeasible}) {
    solution.status = status;
    EXPECT_EQ(infeasibility_of(solution, 1), nullptr);
  }
}

TEST(Infeasibility, ARecordKeepsItAndForgetsItWithTheNextSolve) {
  JobRecord record({.id = "1", .equalities = 1, .inequalities = 0, .pairs = 1}, {}, 8);
  record.answered(infeasible({1.0, 2.0, 0.0}), 0.0);
  v1::GetJobResponse message;
  to_message(record, &message);
  ASSERT_TRUE(message.has_infeasibility());
  EXPECT_EQ(message.infeasibility().rows(0), 1);
  EXPECT_EQ(message.infeasibility().multipliers(0), 2.0);
  const JobSnapshot again = snapshot_of(message);
  EXPECT_EQ(rows_of(*again.infeasibility), (std::vector<Index>{1, 0}));
  record.answered(Solution(), 0.0);
  EXPECT_EQ(record.snapshot().infeasibility, nullptr);
}

TEST(Infeasibility, AStoredOneIsShortenedToItsLimits) {
  v1::GetJobResponse message;
  v1::Infeasibility& stored = *message.mutable_infeasibility();
  for (int i = 0; i < 1000; ++i) {
    stored.mutable_conflict()->add_inequalities(-i);
    stored.add_rows(i);
  }
  for (int i = 0; i < 500; ++i) stored.add_multipliers(i);
  stored.set_more_parts(std::numeric_limits<std::int64_t>::max());
  stored.set_more_rows(std::numeric_limits<std::int64_t>::min());
  const auto why = snapshot_of(message).infeasibility;
  EXPECT_EQ(why->conflict->size(), Infeasibility::kMostParts);
  EXPECT_EQ(why->rows.size(), Infeasibility::kMostRows);
  EXPECT_GT(why->more_parts, 0);
  EXPECT_EQ(why->more_rows, 0);
}

}  // namespace
}  // namespace marble::server
