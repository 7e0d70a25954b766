// What a session is made of, without a stream: merged updates, its share of the limits.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "calls/waiting_updates.h"
#include "jobs/job_board.h"
#include "jobs/session_table.h"
#include "metrics/metrics.h"

namespace marble::server {
namespace {

using Values = std::vector<double>;

Values of(std::span<const double> values) { return {values.begin(), values.end()}; }

constexpr PartSizes kSizes{.g = 12, .b = 3, .d = 4, .l = 2, .r = 2, .Q = 12, .A = 3, .C = 4, .L = 2, .R = 2};

Update checked(v1::SessionUpdate message, const Options& in_force = {}) {
  return Update::check(message, kSizes, in_force).value();
}

v1::SessionUpdate numbered(std::int64_t sequence) {
  v1::SessionUpdate message;
  message.set_sequence(sequence);
  return message;
}

// Moves `count` variables from `first` on by `by`.
v1::SessionUpdate shifting(Index first, Index count, Index by) {
  v1::SessionUpdate message;
  v1::ShiftBlock* block = message.mutable_shift()->add_variables();
  block->set_first(first), block->set_count(count), block->set_by(by);
  return message;
}

std::shared_ptr<Update> update_of(std::int64_t sequence) {
  return std::make_shared<Update>(checked(numbered(sequence)));
}

TEST(SessionUpdate, IsRefusedOnPathsOfTheMessage) {
  const auto refused = [](v1::SessionUpdate message) {
    return Update::check(message, kSizes, {}).error().message();
  };
  v1::SessionUpdate message;
  message.mutable_problem()->add_gradient(1.0);
  EXPECT_EQ(refused(message), "update.problem.gradient = 1 entries: must have 12 entries");
  message = {};
  message.mutable_problem()->mutable_hessian_values()->Resize(12, NAN);
  EXPECT_EQ(refused(message), "update.problem.hessian_values[0] = nan: must be finite");
  message = {};
  message.mutable_initial_point()->add_z(1.0);
  EXPECT_EQ(refused(message), "update.initial_point.z = 1 entries: must have 12 entries");
  EXPECT_EQ(refused(shifting(0, 13, 1)), "update.shift.variables[0].count = 13: must be in [0, 12]");
  message = {};
  message.set_deadline_s(-1.0);
  EXPECT_EQ(refused(message), "update.deadline_s = -1.000000: must be >= 0");
  message = {};
  message.mutable_options()->set_max_iterations(-1);
  EXPECT_TRUE(refused(message).starts_with("update.options.max_iterations = -1: ")) << refused(message);
}

TEST(SessionUpdate, ItsOptionsAreThoseInForceButForWhatItSets) {
  Options in_force;
  in_force.max_iterations = 7;
  v1::SessionUpdate message;
  message.mutable_options()->set_num_starts(3);
  const Update update = checked(message, in_force);
  EXPECT_EQ(update.options().max_iterations, 7);
  EXPECT_EQ(update.checked().options()->num_starts, 3);
}

TEST(SessionUpdate, ASolveEndsByItsDeadline) {
  v1::SessionUpdate message;
  message.set_deadline_s(0.25);
  const Update update = checked(message);
  EXPECT_EQ(update.deadline() - update.arrival(), std::chrono::milliseconds(250));
  EXPECT_LE(update.checked().options()->time_limit_s, 0.25);
  EXPECT_EQ(checked({}).deadline(), Clock::time_point::max());
  EXPECT_EQ(checked({}).checked().options()->time_limit_s, Options().time_limit_s);
}

TEST(SessionUpdate, TakesAlongWhatItDoesNotChangeItself) {
  v1::SessionUpdate older;
  older.mutable_problem()->set_constant(1.0);
  older.mutable_problem()->mutable_gradient()->Resize(12, 1.0);
  older.mutable_problem()->mutable_left_offset()->Resize(2, 2.0);
  older.mutable_problem()->mutable_right_values()->Resize(2, 3.0);
  older.mutable_initial_point()->mutable_z()->Resize(12, 4.0);
  older.set_cold(true);
  v1::SessionUpdate message = numbered(9);
  message.mutable_problem()->mutable_gradient()->Resize(12, 10.0);
  Update newer = checked(message);
  newer.take_along(checked(older));
  EXPECT_EQ(newer.sequence(), 9);
  const CheckedUpdate both = newer.checked();
  EXPECT_EQ(both.numbers().c0, 1.0);
  EXPECT_EQ(of(both.numbers().g), Values(12, 10.0));
  EXPECT_EQ(of(both.numbers().l), Values(2, 2.0));
  EXPECT_EQ(of(both.numbers().R), Values(2, 3.0));
  EXPECT_EQ(of(both.restart().initial_z), Values(12, 4.0));
  EXPECT_TRUE(both.restart().cold);
}

TEST(SessionUpdate, TakesAlongAnInitialPointUnlessItHasNumbersOfItsOwn) {
  v1::SessionUpdate older, empty, other;
  older.mutable_initial_point()->mutable_z()->Resize(12, 4.0);
  (void)empty.mutable_initial_point();
  other.mutable_initial_point()->mutable_z()->Resize(12, 5.0);
  Update without = checked(empty), with = checked(other);
  without.take_along(checked(older));
  with.take_along(checked(older));
  EXPECT_EQ(of(without.checked().restart().initial_z), Values(12, 4.0));
  EXPECT_EQ(of(with.checked().restart().initial_z), Values(12, 5.0));
}

TEST(SessionUpdate, ShiftsOfAnUpdateThatIsTakenAlongComeFirst) {
  const Update older = checked(shifting(0, 12, 1));
  Update newer = checked(shifting(6, 6, 3));
  Values expected(12), moved(12);
  std::iota(expected.begin(), expected.end(), 0.0);
  moved = expected;
  shift(older.checked().restart().shift.variables, expected);
  shift(newer.checked().restart().shift.variables, expected);
  newer.take_along(older);
  shift(newer.checked().restart().shift.variables, moved);
  EXPECT_EQ(moved, expected);
}

v1::SessionUpdate asking_for_derivatives(int directions) {
  v1::SessionUpdate message = numbered(1);
  v1::DirectionsRequest& request = *message.mutable_sensitivity()->mutable_directions();
  request.set_count(directions);
  for (int k = 0; k < directions * static_cast<int>(kSizes.b); ++k)
    request.mutable_numbers()->add_equality_offset(1.0);
  return message;
}

TEST(SessionUpdate, DerivativesAreItsOwnAndAreNotTakenAlong) {
  const SensitivityLimits limits{.rows = 1, .directions = 4, .bytes = 1 << 20};
  const auto made = [&](int directions) {
    v1::SessionUpdate message = asking_for_derivatives(directions);
    return Update::check(message, kSizes, {}, limits);
  };
  const Update asks = made(4).value();
  EXPECT_EQ(asks.sensitivity()->directions.count, 4);
  EXPECT_GE(asks.sensitivity_bytes(), 4 * 23 * 8) << "room for four changes";
  EXPECT_LE(asks.bytes(), 16) << "which is counted by itself";
  Update newer = checked(numbered(2));
  newer.take_along(asks);
  EXPECT_FALSE(newer.sensitivity().has_value());
  EXPECT_EQ(made(5).error().message(),
            "update.sensitivity.directions.count = 5: must be at most 4 (sensitivity_directions)");
  v1::SessionUpdate first_part = asking_for_derivatives(1);
  first_part.set_prepare(true);
  EXPECT_EQ(Update::check(first_part, kSizes, {}, limits).error().field, "update.sensitivity");
}

TEST(SessionUpdate, WithoutRoomForDerivativesItIsSolvedWithoutThem) {
  v1::SessionUpdate message = asking_for_derivatives(1);
  Update update = Update::check(message, kSizes, {}, {.rows = 1, .directions = 1, .bytes = 1 << 20}).value();
  EXPECT_FALSE(update.lacks_sensitivity_room());
  update.give_sensitivity_room(nullptr);
  EXPECT_TRUE(update.lacks_sensitivity_room());
  EXPECT_FALSE(update.sensitivity().has_value());
  EXPECT_EQ(update.sensitivity_bytes(), 0);
}

TEST(WaitingUpdates, GoInTheirOrder) {
  WaitingUpdates waiting(false);
  EXPECT_TRUE(waiting.has_room());
  EXPECT_FALSE(waiting.push(update_of(1), nullptr).has_value());
  EXPECT_FALSE(waiting.has_room());
  EXPECT_FALSE(waiting.push(update_of(2), nullptr).has_value());
  EXPECT_EQ(waiting.pop()->sequence(), 1);
  EXPECT_EQ(waiting.pop()->sequence(), 2);
  EXPECT_TRUE(waiting.empty());
}

TEST(WaitingUpdates, WhatWasLeftBehindGoesWithTheNext) {
  WaitingUpdates waiting(false);
  v1::SessionUpdate left;
  left.mutable_problem()->set_constant(1.0);
  waiting.leave_behind(checked(left));
  EXPECT_TRUE(waiting.empty());
  static_cast<void>(waiting.push(update_of(2), nullptr));
  left.mutable_problem()->mutable_gradient()->Resize(12, 3.0);
  waiting.leave_behind(checked(left));
  const auto next = waiting.pop();
  EXPECT_EQ(next->checked().numbers().c0, 1.0);
  EXPECT_EQ(of(next->checked().numbers().g), Values(12, 3.0));
}

TEST(WaitingUpdates, ALatestOneIsNeverLargerThanAWholeUpdate) {
  WaitingUpdates waiting(true);
  for (int i = 1; i <= 1000; ++i) {
    v1::SessionUpdate message = shifting(0, 12, 1);
    message.set_sequence(i);
    const auto superseded = waiting.push(std::make_shared<Update>(checked(message)), nullptr);
    EXPECT_EQ(superseded.value_or(0), i - 1);
    EXPECT_TRUE(waiting.has_room());
  }
  const auto last = waiting.pop();
  EXPECT_TRUE(waiting.empty());
  EXPECT_LE(last->bytes(), most_update_bytes(kSizes));
  EXPECT_TRUE(last->checked().restart().check(kSizes)) << "the session would refuse what it has joined";
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
