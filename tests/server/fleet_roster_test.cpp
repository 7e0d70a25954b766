#include "fleet/fleet_roster.h"

#include <gtest/gtest.h>

namespace marble::server {
namespace {

TEST(FleetRoster, APortOnAllAddressesIsListedWithTheNameOfTheMachine) {
  EXPECT_EQ(reachable("0.0.0.0:50051", "solver-1"), "solver-1:50051");
  EXPECT_EQ(reachable("[::]:50051", "solver-1"), "solver-1:50051");
  EXPECT_EQ(reachable("https://0.0.0.0:50080", "solver-1"), "https://solver-1:50080");
  EXPECT_EQ(reachable("http://[::]:50080", "solver-1"), "http://solver-1:50080");
}

TEST(FleetRoster, OtherAddressesStayAsTheyAre) {
  for (const std::string address : {"127.0.0.1:50051", "[::1]:50051", "10.0.0.0.0:1", "unix:/run/marble",
                                    "http://10.0.0.7:50080", "", "none", "http://none"})
    EXPECT_EQ(reachable(address, "solver-1"), address);
}

TEST(FleetRoster, OnlyAddressesOfWebServersAreLinks) {
  for (const std::string page : {"http://solver-1:50080", "https://10.0.0.7:50080", "http://[::1]:50080"})
    EXPECT_EQ(checked_page(page), page);
  for (const std::string page :
       {"", "http://", "javascript:alert(1)", "http://user@host", "http://host/path", "http://host:1\n",
        "ftp://host", "//host", "HTTP://host", "http://h\xc3\xb6st"})
    EXPECT_EQ(checked_page(page), "") << page;
}

}  // namespace
}  // namespace marble::server
