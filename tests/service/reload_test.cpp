// SIGHUP: what changes while the server runs, what does not, and what must not.
#include "secure_service_test.h"

namespace marble::testing {
namespace {

class Reload : public SecureServiceTest {
 protected:
  void reload() { server().send(SIGHUP); }
  /// How often the log says it, once it says it often enough.
  bool eventually_reloaded(std::size_t times) {
    return eventually([&] { return server().log_lines({" reloaded "}).size() >= times; });
  }
};

TEST_F(Reload, AddsAndRemovesTokens) {
  const Token first = new_token("first:solve"), second = new_token("second:observe");
  const std::string file = write("tokens", first.line);
  start({"--tokens", file});
  EXPECT_TRUE(ask(bearer(first.secret)).ok());
  EXPECT_FALSE(ask(bearer(second.secret)).ok());
  write("tokens", second.line);
  EXPECT_TRUE(ask(bearer(first.secret)).ok()) << "not before it is asked to";
  reload();
  ASSERT_TRUE(eventually_reloaded(1));
  EXPECT_FALSE(ask(bearer(first.secret)).ok());
  EXPECT_TRUE(ask(bearer(second.secret)).ok());
  EXPECT_EQ(server().log_lines({"reloaded", "tokens"}).size(), 1U) << server().log();
}

TEST_F(Reload, ChangesQuotas) {
  write("config.toml", "client_queued = 7\n");
  start({"--config", directory_.file("config.toml")});
  EXPECT_EQ(ask().info.limits().quota().queued(), 7);
  write("config.toml", "client_queued = 8\n[clients.planner]\nqueued = 9\n");
  reload();
  ASSERT_TRUE(eventually_reloaded(1));
  EXPECT_EQ(ask().info.limits().quota().queued(), 8);
  EXPECT_EQ(ask({{"marble-client", "planner"}}).info.limits().quota().queued(), 9);
  EXPECT_EQ(server().log_lines({"reloaded", "client_queued, clients.planner"}).size(), 1U) << server().log();
  write("config.toml", "");
  reload();
  ASSERT_TRUE(eventually_reloaded(2));
  EXPECT_EQ(ask({{"marble-client", "planner"}}).info.limits().quota().queued(), 256)
      << "a quarter of the queue's";
}

TEST_F(Reload, ChangesTheLogLevel) {
  write("config.toml", "log_level = \"error\"\n");
  start({"--config", directory_.file("config.toml")});
  EXPECT_TRUE(server().log_lines({"listening"}).empty());
  write("config.toml", "log_level = \"info\"\n");
  reload();
  EXPECT_TRUE(eventually_logged({"reloaded", "log_level"}));
}

TEST_F(Reload, WithoutAChangeSaysSo) {
  start();
  reload();
  EXPECT_TRUE(eventually_logged({"reloaded", "nothing"}));
  EXPECT_TRUE(lives());
}

TEST_F(Reload, WarnsOfWhatOnlyARestartChanges) {
  write("config.toml", "queue_jobs = 10\nclient_queued = 1\n");
  start({"--config", directory_.file("config.toml")});
  write("config.toml", "queue_jobs = 20\nclient_queued = 2\n[solver]\nmax_iterations = 5\n");
  reload();
  ASSERT_TRUE(eventually_reloaded(1));
  EXPECT_FALSE(server().log_lines({"needs_restart", "\"queue_jobs\"", "config.toml:1"}).empty())
      << server().log();
  EXPECT_FALSE(server().log_lines({"needs_restart", "\"solver.max_iterations\""}).empty()) << server().log();
  const v1::Limits limits = ask().info.limits();
  EXPECT_EQ(limits.queue_jobs(), 10);
  EXPECT_EQ(limits.quota().queued(), 2) << "what can change does";
}

TEST_F(Reload, AnInvalidFileChangesNothing) {
  const Token token = new_token("planner:solve");
  write("tokens", token.line);
  const std::string tokens = "tokens = \"" + directory_.file("tokens") + "\"\n";
  write("config.toml", tokens + "client_queued = 7\n");
  start({"--config", directory_.file("config.toml")});
  write("config.toml", tokens + "client_queued = 8\nworkerz = 1\n");
  reload();
  ASSERT_TRUE(eventually_logged({"reload_refused", "config.toml:3", "workerz"})) << server().log();
  EXPECT_EQ(ask(bearer(token.secret)).info.limits().quota().queued(), 7);
  write("tokens", "nonsense\n");
  write("config.toml", tokens + "client_queued = 8\n");
  reload();
  ASSERT_TRUE(eventually_logged({"reload_refused", "tokens:1"})) << server().log();
  EXPECT_EQ(ask(bearer(token.secret)).info.limits().quota().queued(), 7) << "nor does half of it";
}

}  // namespace
}  // namespace marble::testing
