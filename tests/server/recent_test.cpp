// What is known of the last minutes, by a clock that the test moves.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "jobs/client_use.h"
#include "jobs/latencies.h"
#include "jobs/recent_json.h"
#include "jobs/server_history.h"

namespace marble::server {
namespace {

using Json = nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Clock::time_point kBegin{seconds(3000)};  // where a slice begins

TEST(Latencies, NothingAnsweredHasNone) {
  const Latencies latencies;
  EXPECT_TRUE(std::isnan(latencies.quantiles(kBegin).median_s));
  EXPECT_TRUE(std::isnan(latencies.quantiles(kBegin).p99_s));
}

TEST(Latencies, AreRightToSixPercent) {
  Latencies latencies;
  for (int i = 1; i <= 1000; ++i) latencies.add(kBegin + milliseconds(10 * i), 1e-3 * i);
  const auto reported = latencies.quantiles(kBegin + seconds(11));
  EXPECT_NEAR(reported.median_s, 0.5, 0.03);
  EXPECT_NEAR(reported.p99_s, 0.99, 0.06);
}

TEST(Latencies, OldOnesAreForgottenAndAnExtremeOneHasABucket) {
  Latencies latencies;
  latencies.add(kBegin, 1e9);
  latencies.add(kBegin + seconds(30), -1.0);
  latencies.add(kBegin + seconds(30), 0.0);
  EXPECT_GT(latencies.quantiles(kBegin + seconds(30)).p99_s, 1e3);
  EXPECT_LT(latencies.quantiles(kBegin + seconds(30), 10).p99_s, 1e-4);
  EXPECT_LT(latencies.quantiles(kBegin + seconds(61)).p99_s, 1e-4);
  EXPECT_TRUE(std::isnan(latencies.quantiles(kBegin + seconds(90)).p99_s));
}

TEST(ClientUses, TimeOfALongJobCountsWhenItWasSpent) {
  ClientUses uses;
  uses.add(kBegin + seconds(10), "long", 1000.0, true);
  EXPECT_NEAR(uses.sum(kBegin + seconds(10)).clients.at("long").busy_s, 280.0, 1e-6)
      << "nine slices and a third";
  EXPECT_EQ(uses.sum(kBegin + seconds(10)).clients.at("long").done, 1);
  EXPECT_NEAR(uses.sum(kBegin + seconds(10 + 150)).clients.at("long").busy_s, 130.0, 1e-6);
  EXPECT_TRUE(uses.sum(kBegin + seconds(10 + 300)).clients.empty());
}

TEST(ClientUses, ASumHasTheTimeOfItsSlices) {
  EXPECT_NEAR(ClientUses::seconds(kBegin + seconds(10)), 280.0, 1e-6);
  EXPECT_NEAR(ClientUses::seconds(kBegin + milliseconds(29999)), 299.999, 1e-6);
}

TEST(ClientUses, WhatHasNoAnswerTookTimeAllTheSame) {
  ClientUses uses;
  uses.add(kBegin + seconds(5), "a", 2.0, false);
  uses.add(kBegin + seconds(6), "a", 0.5, true);
  const ClientUse use = uses.sum(kBegin + seconds(7)).clients.at("a");
  EXPECT_EQ(use.done, 1);
  EXPECT_NEAR(use.busy_s, 2.5, 1e-9);
}

TEST(ClientUses, WhoeverInventsNamesGetsOneForAllOfThem) {
  ClientUses uses;
  uses.add(kBegin, "known", 0.0, true);
  for (int i = 0; i < 100000; ++i) uses.add(kBegin + seconds(1), "name " + std::to_string(i), 1e-5, true);
  uses.add(kBegin + seconds(2), "known", 0.0, true);
  const ClientUses::Sum sum = uses.sum(kBegin + seconds(2));
  EXPECT_EQ(sum.clients.size(), ClientUses::kMostClients);
  EXPECT_EQ(sum.clients.at("known").done, 2);
  EXPECT_EQ(sum.others.done, 100000 - 63);
}

TEST(ServerHistory, LooksTwiceASecondAndKeepsTheNewest) {
  int looks = 0;
  ServerHistory history([&] { return ServerHistory::Point{.time_s = static_cast<double>(looks++)}; });
  for (int i = 0; i < 100; ++i) history.on_timer(kBegin + milliseconds(25 * i));
  EXPECT_EQ(looks, 5);
  EXPECT_EQ(history.points().size(), 5U);
  for (int i = 1; i < 2000; ++i) history.on_timer(kBegin + seconds(10 * i));
  const auto points = history.points();
  ASSERT_EQ(points.size(), ServerHistory::kMostPoints);
  for (std::size_t at = 0; at < points.size(); ++at)
    ASSERT_EQ(points[at].time_s, static_cast<double>(looks) - static_cast<double>(points.size() - at));
}

TEST(RecentJson, AWholeHistoryFitsIntoAShortAnswer) {
  ServerHistory::Point point;
  point.time_s = 123456789.123456789;
  point.queued = point.running = 1e5 - 1;
  point.done = 1e10 - 1;
  point.busy_s = point.cpu_s = 1e10 / 3;
  point.median_s = 1e-3 / 3;
  point.p99_s = 1e4 / 3;
  const std::vector points(ServerHistory::kMostPoints, point);
  const std::string text = history_json(points);
  EXPECT_LT(text.size(), 64U << 10);
  const Json json = Json::parse(text);
  EXPECT_EQ(json.at("p99_s").size(), points.size());
  EXPECT_NEAR(json.at("p50_s").at(0).get<double>(), 1e-3 / 3, 1e-7);
  EXPECT_EQ(json.at("done").at(0).get<double>(), 1e10 - 1);
}

TEST(RecentJson, WhatIsNotKnownIsNull) {
  ServerHistory::Point point;
  point.median_s = std::nan("");
  const Json json = Json::parse(history_json({point}));
  EXPECT_TRUE(json.at("p50_s").at(0).is_null());
}

TEST(RecentJson, WhoMayNotSeeAllSeesItselfAlone) {
  ClientShares shares;
  shares.clients = {{"a", 1, 2, {3, 4.0}}, {"b\xff\"", 5, 6, {7, 8.0}}};
  shares.others = {"", 9, 10, {11, 12.0}};
  const Json all = Json::parse(clients_json(shares));
  EXPECT_EQ(all.at("clients").size(), 2U);
  EXPECT_EQ(all.at("others").at("done"), 11);
  const Json own = Json::parse(clients_json(shares, "a"));
  ASSERT_EQ(own.at("clients").size(), 1U);
  EXPECT_EQ(own.at("clients").at(0).at("busy_s"), 4.0);
  EXPECT_EQ(own.at("others").at("done"), 0);
  EXPECT_EQ(own.at("others").at("queued"), 0);
}

}  // namespace
}  // namespace marble::server
