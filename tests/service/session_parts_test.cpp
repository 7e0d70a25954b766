// What a session is made of, without a stream: merged updates, its share of the limits.
#include <gtest/gtest.h>

#include <numeric>

#include "job_board.h"
#include "metrics/metrics.h"
#include "session_table.h"
#include "waiting_updates.h"

namespace marble::server {
namespace {

using Values = std::vector<double>;

Values of(const google::protobuf::RepeatedField<double>& field) { return {field.begin(), field.end()}; }

constexpr PartSizes kSizes{.g = 12, .b = 3, .d = 4, .l = 2, .r = 2, .Q = 12, .A = 3, .C = 4, .L = 2, .R = 2};

std::shared_ptr<Update> update_of(std::int64_t sequence, std::vector<ShiftBlock> blocks = {}) {
  auto update = std::make_shared<Update>();
  update->message.set_sequence(sequence);
  update->shift.variables = std::move(blocks);
  return update;
}

TEST(SessionUpdate, TakesAlongWhatItDoesNotChangeItself) {
  Update older, newer;
  older.message.mutable_problem()->set_constant(1.0);
  older.message.mutable_problem()->add_gradient(1.0);
  older.message.mutable_problem()->add_left_offset(2.0);
  older.message.mutable_problem()->add_right_values(3.0);
  older.message.mutable_initial_point()->add_z(4.0);
  older.message.set_cold(true);
  newer.message.set_sequence(9);
  newer.message.mutable_problem()->add_gradient(10.0);
  take_along(older, newer, kSizes);
  const v1::SessionUpdate& message = newer.message;
  EXPECT_EQ(message.sequence(), 9);
  EXPECT_EQ(message.problem().constant(), 1.0);
  EXPECT_EQ(of(message.problem().gradient()), Values{10.0});
  EXPECT_EQ(of(message.problem().left_offset()), Values{2.0});
  EXPECT_EQ(of(message.problem().right_values()), Values{3.0});
  EXPECT_EQ(of(message.initial_point().z()), Values{4.0});
  EXPECT_TRUE(message.cold());
}

TEST(SessionUpdate, ShiftsOfAnUpdateThatIsTakenAlongComeFirst) {
  Update older = *update_of(1, {{.first = 0, .count = 12, .by = 1}});
  Update newer = *update_of(2, {{.first = 6, .count = 6, .by = 3}});
  Values expected(12), moved(12);
  std::iota(expected.begin(), expected.end(), 0.0);
  moved = expected;
  shift(older.shift.variables, expected);
  shift(newer.shift.variables, expected);
  take_along(std::move(older), newer, kSizes);
  shift(newer.shift.variables, moved);
  EXPECT_EQ(moved, expected);
}

TEST(WaitingUpdates, GoInTheirOrder) {
  WaitingUpdates waiting(false, kSizes);
  EXPECT_TRUE(waiting.has_room());
  EXPECT_FALSE(waiting.push(update_of(1), nullptr).has_value());
  EXPECT_FALSE(waiting.has_room());
  EXPECT_FALSE(waiting.push(update_of(2), nullptr).has_value());
  EXPECT_EQ(waiting.pop()->message.sequence(), 1);
  EXPECT_EQ(waiting.pop()->message.sequence(), 2);
  EXPECT_TRUE(waiting.empty());
}

TEST(WaitingUpdates, WhatWasLeftBehindGoesWithTheNext) {
  WaitingUpdates waiting(false, kSizes);
  Update left;
  left.message.mutable_problem()->set_constant(1.0);
  waiting.leave_behind(left);
  EXPECT_TRUE(waiting.empty());
  static_cast<void>(waiting.push(update_of(2), nullptr));
  left.message.mutable_problem()->add_gradient(3.0);
  waiting.leave_behind(left);
  const auto next = waiting.pop();
  EXPECT_EQ(next->message.problem().constant(), 1.0);
  EXPECT_EQ(of(next->message.problem().gradient()), Values{3.0});
}

TEST(WaitingUpdates, ALatestOneIsNeverLargerThanAWholeUpdate) {
  WaitingUpdates waiting(true, kSizes);
  for (int i = 1; i <= 1000; ++i) {
    const auto superseded = waiting.push(update_of(i, {{.first = 0, .count = 12, .by = 1}}), nullptr);
    EXPECT_EQ(superseded.value_or(0), i - 1);
    EXPECT_TRUE(waiting.has_room());
  }
  const auto last = waiting.pop();
  EXPECT_TRUE(waiting.empty());
  EXPECT_LE(bytes_of(*last), most_update_bytes(kSizes));
  EXPECT_TRUE(restart_of(*last).check(kSizes)) << "the session would refuse what it has joined";
}

TEST(SessionTable, GivesPlacesBackAndCountsWhoseTheyAre) {
  SessionTable table({.sessions = 3, .bytes = 100});
  const Quota one{.sessions = 1};
  auto a = table.open("a", one);
  ASSERT_TRUE(a.has_value());
  EXPECT_EQ(table.open("a", one).error().field, "client_sessions");
  auto b = table.open("b", one);
  const auto c = table.open("c", one);
  EXPECT_EQ(table.open("d", one).error().field, "sessions");
  EXPECT_TRUE((*a)->take(60).has_value());
  EXPECT_EQ((*b)->take(50).error().field, "session_bytes");
  EXPECT_TRUE((*b)->take(40).has_value());
  EXPECT_EQ(table.room(), 0);
  a->reset();
  EXPECT_EQ(table.room(), 60);
  EXPECT_TRUE(table.open("a", one).has_value());
  EXPECT_EQ(table.usage().sessions, 2);
  EXPECT_EQ(table.usage().total, 4);
}

}  // namespace
}  // namespace marble::server
