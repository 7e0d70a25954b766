#include <gtest/gtest.h>

#include "base/page_url.h"
#include "base/postgres.h"
#include "fleet/fleet_roster.h"
#include "support/postgres_process.h"

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

// A connection to a real PostgreSQL that dies at any moment: the caller learns of it within bounded time.
using marble::testing::eventually, marble::testing::PostgresProcess;

class PostgresConnection : public ::testing::Test {
 protected:
  [[nodiscard]] Postgres open() {
    auto opened = Postgres::open(database_.uri());
    EXPECT_TRUE(opened) << opened.error().bound;
    EXPECT_TRUE(opened->run("CREATE TEMPORARY TABLE kept (value bytea)"));
    return std::move(*opened);
  }
  /// Within a transaction, several statements of so many bytes each.
  static Expected<void> write(Postgres& connection, std::size_t bytes) {
    std::vector<PgStatement> all;
    for (int i = 0; i < 4; ++i)
      all.push_back(PgStatement("INSERT INTO kept VALUES ($1)").blob(std::string(bytes, 'x')));
    all.emplace_back("COMMIT");
    const auto made = connection.run(all);
    return made ? Expected<void>() : unexpected(made.error());
  }

  PostgresProcess database_{MARBLE_POSTGRES_DIR};
};

TEST_F(PostgresConnection, OfAServerThatDiesIsReportedAndClosedWhateverIsSent) {
  for (const std::size_t bytes : {0, 1'000, 40'000, 100'000, 2'000'000}) {
    for (const bool killed : {true, false}) {
      Postgres within = open(), idle = open(), later = open();
      ASSERT_TRUE(within.run("BEGIN"));
      ASSERT_TRUE(write(idle, bytes)) << "it takes so much";
      if (killed) {
        database_.kill();
      } else {
        database_.stop();
      }
      for (Postgres* const connection : {&within, &idle}) {  // a backend may live for a moment
        Expected<void> written;
        ASSERT_TRUE(eventually([&] { return !(written = write(*connection, bytes)); })) << bytes;
        EXPECT_EQ(written.error().code, ErrorCode::unavailable);
        EXPECT_FALSE(write(*connection, bytes)) << "and reports so again";
      }
      EXPECT_TRUE(eventually([&] { return !later.wait(-1, std::chrono::milliseconds(10)); }));
      database_.start();
    }
  }
}

TEST_F(PostgresConnection, OfAServerThatHangsIsReportedAndClosed) {
  Postgres connection = open();
  const auto pid = connection.run("SELECT pg_backend_pid()::bigint");
  ASSERT_TRUE(pid);
  const auto backend = static_cast<pid_t>(pid->integer(0, 0));
  kill(backend, SIGSTOP);
  EXPECT_EQ(write(connection, 10'000).error().bound, "does not answer");
  EXPECT_FALSE(connection.is_open());
  kill(backend, SIGCONT);
}

TEST_F(PostgresConnection, SaysWhatFailedAndGoesOn) {
  Postgres connection = open();
  EXPECT_FALSE(connection.run("SELECT 1/0"));
  EXPECT_EQ(connection.state(), "22012");
  const auto one = connection.run("SELECT 1::bigint");
  ASSERT_TRUE(one);
  EXPECT_EQ(one->integer(0, 0), 1);
}

}  // namespace
}  // namespace marble::server
