#include "access/access.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "base/tokens.h"

namespace marble::server {
namespace {

Credentials anonymous(const std::string& peer) { return {peer, std::nullopt, std::nullopt, std::nullopt}; }
Credentials with_token(const std::string& token) {
  return {"ipv4:127.0.0.1:1", token, std::nullopt, std::nullopt};
}
Credentials with_certificate(const std::string& name) {
  return {"ipv4:127.0.0.1:1", std::nullopt, name, std::nullopt};
}

/// A configuration that knows one token.
Config config_of(const NewToken& token) {
  Config config;
  config.tokens = "tokens";
  std::vector<LineFault> faults;
  config.known_tokens = parse_tokens(token.line, faults);
  EXPECT_TRUE(faults.empty());
  return config;
}

Config config_with_certificates() {
  Config config;
  config.tls_certificate = "certificate.pem";
  config.tls_client_ca = "authority.pem";
  return config;
}

TEST(Access, WithoutCredentialsEveryoneHasEveryRole) {
  const Access access{Config()};
  for (const Role role : {Role::solve, Role::observe, Role::admin})
    EXPECT_TRUE(access.require(anonymous("ipv4:127.0.0.1:1"), role).has_value());
}

TEST(Access, AnonymousClientsAreTheirHost) {
  const Access access{Config()};
  EXPECT_EQ(access.identify(anonymous("ipv4:10.0.0.7:4711"))->client, "10.0.0.7");
  EXPECT_EQ(access.identify(anonymous("ipv6:%5B::1%5D:4711"))->client, "::1");
  EXPECT_EQ(access.identify(anonymous("ipv6:[2001:db8::7]:4711"))->client, "2001:db8::7");
  EXPECT_EQ(access.identify(anonymous("unix:"))->client, "unix");
  EXPECT_EQ(access.identify(anonymous("unix:/run/marble.sock"))->client, "unix");
  EXPECT_EQ(access.identify(anonymous("odd"))->client, "odd");
}

TEST(Access, AnonymousClientsMayNameThemselves) {
  const Access access{Config()};
  Credentials given = anonymous("ipv4:127.0.0.1:1");
  given.name = "planner 1";
  EXPECT_EQ(access.identify(given)->client, "planner 1");
  for (const std::string& wrong :
       {std::string(), std::string(65, 'x'), std::string("tab\t"), std::string("\xc3")}) {
    given.name = wrong;
    const auto refused = access.identify(given);
    ASSERT_FALSE(refused.has_value());
    EXPECT_EQ(refused.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(refused.error().field, "marble-client");
  }
}

TEST(Access, ARoleThatIsMissingIsNamed) {
  const auto token = new_token("watcher:observe");
  const Access access(config_of(*token));
  EXPECT_TRUE(access.require(with_token(token->secret), Role::observe).has_value());
  const auto refused = access.require(with_token(token->secret), Role::solve);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::permission_denied);
  EXPECT_EQ(refused.error().message(), "watcher lacks the role solve");
}

TEST(Access, AnUnknownCallerIsRefusedWhateverItsRole) {
  const auto token = new_token("planner:admin");
  const Access access(config_of(*token));
  for (const Credentials& given :
       {anonymous("unix:"), with_token("wrong"), with_token(""), with_certificate("planner")}) {
    const auto refused = access.require(given, Role::admin);
    ASSERT_FALSE(refused.has_value());
    EXPECT_EQ(refused.error().code, ErrorCode::unauthenticated);
  }
}

TEST(Access, ACertificateSolvesAndObservesUnlessReportedOtherwise) {
  Config config = config_with_certificates();
  config.clients["operator"].roles = Roles{Role::admin};
  const Access access(config);
  EXPECT_EQ(access.identify(with_certificate("planner"))->roles, Roles({Role::solve, Role::observe}));
  EXPECT_EQ(access.identify(with_certificate("operator"))->roles, Roles({Role::admin}));
  EXPECT_EQ(access.identify(anonymous("unix:")).error().code, ErrorCode::unauthenticated);
}

TEST(Access, ACertificateStandsInForATokenButNotForAWrongOne) {
  const auto token = new_token("by token:admin");
  EXPECT_FALSE(token.has_value()) << "a name has no blanks";
  const auto good = new_token("by-token:admin");
  Config config = config_of(*good);
  config.tls_certificate = "certificate.pem";
  config.tls_client_ca = "authority.pem";
  const Access access(config);
  Credentials given = with_certificate("by-certificate");
  EXPECT_EQ(access.identify(given)->client, "cert:by-certificate");
  given.token = "wrong";
  EXPECT_EQ(access.identify(given).error().code, ErrorCode::unauthenticated);
  given.token = good->secret;
  EXPECT_EQ(access.identify(given)->client, "by-token");
}

TEST(Access, AClientsQuotaIsTheDefaultWhereItHasNoneOfItsOwn) {
  Config config;
  config.client_running = 4;
  config.client_priority = "interactive";
  config.clients["planner"].settings["client_queued"] = std::int64_t{7};
  config.clients["planner"].settings["client_running"] = std::int64_t{0};
  const Access access(config);
  EXPECT_EQ(access.quota_of("other").running, 4);
  EXPECT_EQ(access.quota_of("other").queued, config.queue_jobs / 4) << "by default a quarter";
  EXPECT_EQ(access.quota_of("planner").queued, 7);
  EXPECT_EQ(access.quota_of("planner").running, Quota().running) << "0 is no limit";
  EXPECT_EQ(access.quota_of("planner").priority, Priority::interactive);
}

TEST(Access, AClientHasAQuarterOfPlacesSessionsAndWatchersUnlessReportedOtherwise) {
  Config config;
  config.queue_jobs = 80;
  config.sessions = 3;
  config.watchers = 16;
  config.clients["alone"].settings = {{"client_queued", std::int64_t{0}},
                                      {"client_sessions", std::int64_t{0}}};
  const Access access(config);
  const Quota quarter = access.quota_of("other"), own = access.quota_of("alone");
  EXPECT_EQ(quarter.queued, 20);
  EXPECT_EQ(quarter.sessions, 1) << "at least one";
  EXPECT_EQ(quarter.watchers, 4);
  EXPECT_EQ(own.queued, Quota().queued) << "0 is no limit";
  EXPECT_EQ(own.sessions, Quota().sessions);
  EXPECT_EQ(own.watchers, 4);
}

TEST(Access, AReloadCountsFromThenOn) {
  const auto first = new_token("first:solve"), second = new_token("second:solve");
  Access access(config_of(*first));
  Config config = config_of(*second);
  config.client_running = 2;
  access.reload(config);
  EXPECT_FALSE(access.identify(with_token(first->secret)).has_value());
  EXPECT_TRUE(access.identify(with_token(second->secret)).has_value());
  EXPECT_EQ(access.quota_of("second").running, 2);
}

TEST(Access, AReloadDisturbsNobodyWhoCallsMeanwhile) {
  const auto token = new_token("planner:solve");
  const Config config = config_of(*token);
  Access access(config);
  std::atomic<bool> reloaded = false;
  std::thread given([&] {
    while (!reloaded) {
      EXPECT_TRUE(access.identify(with_token(token->secret)).has_value());
      EXPECT_EQ(access.quota_of("planner").running, Quota().running);
    }
  });
  for (int i = 0; i < 1000; ++i) access.reload(config);
  reloaded = true;
  given.join();
}

// SHA-256 of the bytes 00ff and "secret", by the sha256sum command.
constexpr const char* kLine =
    "planner solve,observe sha256:00ff:"
    "ef0e761eb7b7bc46acd2d38ed243b441f7cc14b46502968e5175808376b60895";

std::vector<int> faulty_lines(const std::string& text) {
  std::vector<LineFault> faults;
  static_cast<void>(parse_tokens(text, faults));
  std::vector<int> lines;
  lines.reserve(faults.size());
  for (const LineFault& fault : faults) lines.push_back(fault.line);
  return lines;
}

TEST(Tokens, AHashMadeByOthersIsUnderstood) {
  std::vector<LineFault> faults;
  const auto tokens = parse_tokens(std::string("# people\n\n  ") + kLine + "\r\n", faults);
  EXPECT_TRUE(faults.empty());
  ASSERT_EQ(tokens.size(), 1U);
  EXPECT_EQ(tokens[0].client, "planner");
  EXPECT_EQ(tokens[0].roles, Roles({Role::solve, Role::observe}));
  EXPECT_EQ(find_token(tokens, "secret"), tokens.data());
  EXPECT_EQ(find_token(tokens, "Secret"), nullptr);
  EXPECT_EQ(find_token(tokens, ""), nullptr);
}

TEST(Tokens, ANewOneIsFoundAmongOthersAndOnlyByItsSecret) {
  const auto first = new_token("first:solve"), second = new_token("second:admin,solve");
  ASSERT_TRUE(first && second);
  EXPECT_NE(first->secret, second->secret);
  EXPECT_EQ(first->secret.size(), 64U);
  EXPECT_EQ(first->line.find(first->secret), std::string::npos);
  std::vector<LineFault> faults;
  const auto tokens = parse_tokens(first->line + "\n" + second->line, faults);
  ASSERT_EQ(tokens.size(), 2U);
  EXPECT_EQ(find_token(tokens, first->secret)->client, "first");
  EXPECT_EQ(find_token(tokens, second->secret)->client, "second");
  EXPECT_EQ(find_token(tokens, second->secret)->roles, Roles({Role::admin, Role::solve}));
  EXPECT_EQ(find_token({}, first->secret), nullptr);
}

TEST(Tokens, EveryFaultyLineIsReported) {
  const std::string good = kLine;
  const std::string hash = good.substr(good.rfind(' ') + 1);
  EXPECT_EQ(faulty_lines(good + "\n" +                      //
                         "planner solve\n" +                // no hash
                         good + " more\n" +                 //
                         "planner root " + hash + "\n" +    //
                         "planner solve, " + hash + "\n" +  // a comma too many is no role, and no harm
                         "planner ,solve " + hash + "\n" +  //
                         "planner solve md5:00:00\n" +      //
                         "planner solve sha256::" + hash.substr(hash.rfind(':') + 1) + "\n" +  // no salt
                         good.substr(0, good.size() - 1) + "\n" +                              //
                         good.substr(0, good.size() - 1) + "g\n" +                             //
                         std::string(65, 'x') + " solve " + hash + "\n" +                      //
                         "pl\xc3\xa4ner solve " + hash + "\n"),
            (std::vector<int>{2, 3, 4, 6, 7, 8, 9, 10, 11, 12}));
}

TEST(Tokens, FaultsQuoteNothing) {
  std::vector<LineFault> faults;
  static_cast<void>(parse_tokens("hush hush hush\nx hush sha256:hush:hush\n", faults));
  ASSERT_EQ(faults.size(), 2U);
  for (const LineFault& fault : faults)
    EXPECT_EQ(fault.error.message().find("hush"), std::string::npos) << fault.error.message();
}

}  // namespace
}  // namespace marble::server
