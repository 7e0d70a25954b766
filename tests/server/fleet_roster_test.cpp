#include "fleet/fleet_roster.h"

#include <gtest/gtest.h>

#include "base/page_url.h"

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
  const std::string longest = "http://" + std::string(kLongestPageUrl - 7, 'a');
  EXPECT_EQ(checked_page(longest), longest);
  for (const std::string& page :
       {longest + "a", std::string(), std::string("http://h\0st", 11), std::string("http://"),
        std::string("javascript:alert(1)"), std::string("http://user@host"), std::string("http://host/path"),
        std::string("http://host:1\n"), std::string("ftp://host"), std::string("//host"),
        std::string("HTTP://host"), std::string("http://h\xc3\xb6st")})
    EXPECT_EQ(checked_page(page), "") << page;
}

}  // namespace
}  // namespace marble::server
