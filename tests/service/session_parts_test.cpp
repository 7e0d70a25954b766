// What a session is made of, without a stream: merged updates, its share of the limits.
#include <gtest/gtest.h>

#include "session_table.h"
#include "session_update.h"

namespace marble::server {
namespace {

using Values = std::vector<double>;

Values of(const google::protobuf::RepeatedField<double>& field) { return {field.begin(), field.end()}; }

TEST(SessionUpdate, TakesAlongWhatItDoesNotChangeItself) {
  v1::SessionUpdate older, newer;
  older.mutable_problem()->set_constant(1.0);
  older.mutable_problem()->add_gradient(1.0);
  older.mutable_problem()->add_left_offset(2.0);
  older.mutable_problem()->add_right_values(3.0);
  older.mutable_initial_point()->add_z(4.0);
  older.set_cold(true);
  newer.set_sequence(9);
  newer.mutable_problem()->add_gradient(10.0);
  take_along(older, newer);
  EXPECT_EQ(newer.sequence(), 9);
  EXPECT_EQ(newer.problem().constant(), 1.0);
  EXPECT_EQ(of(newer.problem().gradient()), Values{10.0});
  EXPECT_EQ(of(newer.problem().left_offset()), Values{2.0});
  EXPECT_EQ(of(newer.problem().right_values()), Values{3.0});
  EXPECT_EQ(of(newer.initial_point().z()), Values{4.0});
  EXPECT_TRUE(newer.cold());
}

TEST(SessionUpdate, ShiftsOfAnUpdateThatIsTakenAlongComeFirst) {
  v1::SessionUpdate older, newer;
  older.mutable_shift()->add_variables()->set_by(1);
  newer.mutable_shift()->add_variables()->set_by(2);
  take_along(older, newer);
  ASSERT_EQ(newer.shift().variables_size(), 2);
  EXPECT_EQ(newer.shift().variables(0).by(), 1);
  EXPECT_EQ(newer.shift().variables(1).by(), 2);
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
