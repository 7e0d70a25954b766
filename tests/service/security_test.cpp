// TLS, client certificates and tokens end to end: the right ones, and every wrong one.
#include <gmock/gmock.h>

#include "secure_service_test.h"

namespace marble::testing {
namespace {

using grpc::StatusCode;
using ::testing::ElementsAre;

class Security : public SecureServiceTest {
 protected:
  /// Starts a server with TLS that wants certificates of clients().
  void start_mutual(std::vector<std::string> flags = {}) {
    const auto own = tls_flags(authority_.issue_for_server());
    flags.insert(flags.end(), own.begin(), own.end());
    flags.insert(flags.end(), {"--tls-client-ca", clients_.certificate()});
    start(flags);
  }
  Answer ask_as(const CertificateFiles& own, const Metadata& metadata = {}) {
    return ask(tls(authority_, own), metadata);
  }
  void copy(const CertificateFiles& from, const CertificateFiles& to) {
    const auto over = std::filesystem::copy_options::overwrite_existing;
    std::filesystem::copy_file(from.certificate, to.certificate, over);
    std::filesystem::copy_file(from.key, to.key, over);
  }

  TestAuthority authority_, clients_, unauthenticated_;
};

TEST_F(Security, TlsServesWhoTrustsItsAuthorityAndNobodyInTheClear) {
  start(tls_flags(authority_.issue_for_server()));
  const Answer answer = ask(tls(authority_));
  EXPECT_TRUE(answer.ok()) << answer.status.error_message();
  EXPECT_EQ(answer.info.client(), "127.0.0.1");
  EXPECT_THAT(answer.roles(), ElementsAre("solve", "observe", "admin"));
  EXPECT_EQ(ask().status.error_code(), StatusCode::UNAVAILABLE);
}

TEST_F(Security, SolvesOverTls) {
  start(tls_flags(authority_.issue_for_server()));
  const auto stub = v1::Solver::NewStub(grpc::CreateChannel(server().address(), tls(authority_)));
  grpc::ClientContext context;
  v1::SolveResponse response;
  const grpc::Status status = stub->Solve(&context, example_request(), &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(response.solution().status(), v1::STATUS_SOLVED);
}

TEST_F(Security, AddressesBeyondLoopbackNeedTlsAndKnownCallers) {
  auto flags = tls_flags(authority_.issue_for_server());
  const Token token = new_token("planner:solve");
  flags.insert(flags.end(), {"--listen", "0.0.0.0:0", "--tokens", write("tokens", token.line)});
  start(flags);
  const std::string address = server().address();
  const std::string local = "127.0.0.1" + address.substr(address.rfind(':'));
  EXPECT_TRUE(ask(tls(authority_), bearer(token.secret), local).ok());
}

TEST_F(Security, AUnixSocketStaysWithoutTls) {
  auto flags = tls_flags(authority_.issue_for_server());
  flags.insert(flags.end(), {"--listen", "127.0.0.1:0", "--listen", "unix:" + directory_.file("socket")});
  start(flags);
  const Answer answer = ask(grpc::InsecureChannelCredentials(), {}, server().addresses().at(1));
  EXPECT_TRUE(answer.ok()) << answer.status.error_message();
  EXPECT_EQ(answer.info.client(), "unix");
}

TEST_F(Security, AClientRefusesAnExpiredServer) {
  start(tls_flags(authority_.issue_for_server(-1)));
  const Answer answer = ask(tls(authority_));
  EXPECT_EQ(answer.status.error_code(), StatusCode::UNAVAILABLE);
  EXPECT_NE(answer.status.error_message().find("certificate verify failed"), std::string::npos)
      << answer.status.error_message();
  EXPECT_TRUE(eventually_logged({"certificate_expired"}));
}

TEST_F(Security, AClientRefusesAServerOfAnotherAuthority) {
  start(tls_flags(unauthenticated_.issue_for_server()));
  const Answer answer = ask(tls(authority_));
  EXPECT_EQ(answer.status.error_code(), StatusCode::UNAVAILABLE);
  EXPECT_NE(answer.status.error_message().find("certificate verify failed"), std::string::npos)
      << answer.status.error_message();
  EXPECT_TRUE(ask(tls(unauthenticated_)).ok());
}

TEST_F(Security, AClientRefusesAServerOfAnotherName) {
  start(tls_flags(authority_.issue("server", "DNS:elsewhere.example")));
  const Answer answer = ask(tls(authority_));
  EXPECT_EQ(answer.status.error_code(), StatusCode::UNAVAILABLE);
  EXPECT_NE(answer.status.error_message().find("not in peer certificate"), std::string::npos)
      << answer.status.error_message();
}

TEST_F(Security, ACertificateNamesItsClient) {
  start_mutual();
  const Answer by_name = ask_as(clients_.issue("somebody", "DNS:planner.example,DNS:second.example"));
  ASSERT_TRUE(by_name.ok()) << by_name.status.error_message();
  EXPECT_EQ(by_name.info.client(), "cert:planner.example");
  EXPECT_THAT(by_name.roles(), ElementsAre("solve", "observe"));
  const Answer by_uri = ask_as(clients_.issue("somebody", "URI:spiffe://example/planner"));
  EXPECT_EQ(by_uri.info.client(), "cert:spiffe://example/planner") << by_uri.status.error_message();
  const Answer by_common_name = ask_as(clients_.issue("planner", ""), {{"marble-client", "ignored"}});
  EXPECT_EQ(by_common_name.info.client(), "cert:planner") << by_common_name.status.error_message();
}

TEST_F(Security, TheFileGivesACertificatesClientItsRolesAndQuota) {
  const std::string file =
      write("config.toml",
            "client_queued = 5\n"
            "[clients.planner]\nroles = [\"admin\"]\nqueued = 3\npriority = \"batch\"\n");
  start_mutual({"--config", file});
  const Answer planner = ask_as(clients_.issue("planner", ""));
  EXPECT_THAT(planner.roles(), ElementsAre("admin")) << planner.status.error_message();
  EXPECT_EQ(planner.info.limits().quota().queued(), 3);
  EXPECT_EQ(planner.info.limits().quota().priority(), v1::PRIORITY_BATCH);
  const Answer other = ask_as(clients_.issue("other", ""));
  EXPECT_EQ(other.info.limits().quota().queued(), 5);
  EXPECT_EQ(other.info.limits().quota().priority(), v1::PRIORITY_REALTIME);
}

TEST_F(Security, WrongClientCertificatesAreRefused) {
  start_mutual();
  EXPECT_EQ(ask_as({}).status.error_code(), StatusCode::UNAVAILABLE) << "no certificate";
  EXPECT_EQ(ask_as(clients_.issue("planner", "", -1)).status.error_code(), StatusCode::UNAVAILABLE)
      << "expired";
  EXPECT_EQ(ask_as(unauthenticated_.issue("planner", "")).status.error_code(), StatusCode::UNAVAILABLE)
      << "of another authority";
  EXPECT_EQ(ask_as(authority_.issue("planner", "")).status.error_code(), StatusCode::UNAVAILABLE)
      << "of the server's authority, which is not the clients'";
  EXPECT_TRUE(ask_as(clients_.issue("planner", "")).ok());
}

TEST_F(Security, ARequestedCertificateMayBeReplacedByAToken) {
  const Token token = new_token("watcher:observe");
  start_mutual({"--tls-client", "request", "--tokens", write("tokens", token.line)});
  EXPECT_EQ(ask_as({}).status.error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(ask_as({}, bearer(token.secret)).info.client(), "watcher");
  EXPECT_EQ(ask_as(clients_.issue("planner", "")).info.client(), "cert:planner");
  EXPECT_EQ(ask_as(unauthenticated_.issue("planner", "")).status.error_code(), StatusCode::UNAVAILABLE);
}

TEST_F(Security, ARequestedCertificateIsNeededWhereThereAreNoTokens) {
  start_mutual({"--tls-client", "request"});
  EXPECT_EQ(ask_as({}, {{"marble-client", "planner"}}).status.error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_TRUE(ask_as(clients_.issue("planner", "")).ok());
}

TEST_F(Security, ARenewedCertificateIsServedWithoutARestart) {
  const CertificateFiles files = authority_.issue_for_server();
  start(tls_flags(files));
  EXPECT_TRUE(ask(tls(authority_)).ok());
  EXPECT_FALSE(ask(tls(unauthenticated_)).ok());
  copy(unauthenticated_.issue_for_server(), files);
  EXPECT_TRUE(ask(tls(unauthenticated_)).ok()) << server().log();
  EXPECT_FALSE(ask(tls(authority_)).ok());
}

TEST_F(Security, ARenewedAuthorityOfClientsCountsWithoutARestart) {
  start_mutual();
  EXPECT_FALSE(ask_as(unauthenticated_.issue("planner", "")).ok());
  std::filesystem::copy_file(unauthenticated_.certificate(), clients_.certificate(),
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_TRUE(ask_as(unauthenticated_.issue("planner", "")).ok()) << server().log();
}

TEST_F(Security, BrokenRenewedFilesLeaveTheGoodOnesInForce) {
  const CertificateFiles files = authority_.issue_for_server();
  start(tls_flags(files));
  const auto serves_on = [&](const char* reason) {
    EXPECT_TRUE(ask(tls(authority_)).ok()) << reason;
    EXPECT_TRUE(eventually_logged({"certificate_refused", reason})) << reason << "\n" << server().log();
  };
  const std::string good = read_file(files.certificate);
  std::ofstream(files.certificate) << "garbage";
  serves_on("must hold certificates in PEM form");
  std::ofstream(files.certificate) << good << good.substr(0, good.size() / 2);  // half written
  serves_on("must hold certificates in PEM form");
  std::ofstream(files.certificate) << good;
  std::ofstream(files.key) << read_file(authority_.issue_for_server().key);
  serves_on("must be the key of");
  std::filesystem::remove(files.key);
  serves_on("cannot be read");
  copy(unauthenticated_.issue_for_server(), files);
  EXPECT_TRUE(ask(tls(unauthenticated_)).ok()) << "good files again";
}

TEST_F(Security, OnlyKnownTokensAreLetIn) {
  const Token planner = new_token("planner:solve,observe"), watcher = new_token("watcher:observe");
  start({"--tokens", write("tokens", "# who may call\n\n" + planner.line + watcher.line)});
  const Answer answer = ask(bearer(planner.secret));
  ASSERT_TRUE(answer.ok()) << answer.status.error_message();
  EXPECT_EQ(answer.info.client(), "planner");
  EXPECT_THAT(answer.roles(), ElementsAre("solve", "observe"));
  EXPECT_THAT(ask(bearer(watcher.secret)).roles(), ElementsAre("observe"));
  EXPECT_EQ(ask({{"authorization", "bearer " + planner.secret}, {"marble-client", "other"}}).info.client(),
            "planner")
      << "the scheme's case does not matter, and the token's name wins";
  const std::vector<Metadata> wrong = {{},
                                       bearer(""),
                                       bearer(planner.secret + "0"),
                                       bearer(planner.secret.substr(1)),
                                       {{"authorization", planner.secret}},
                                       {{"authorization", "Basic " + planner.secret}},
                                       {{"marble-client", "planner"}}};
  for (const Metadata& metadata : wrong) {
    EXPECT_EQ(ask(metadata).status.error_code(), StatusCode::UNAUTHENTICATED)
        << (metadata.empty() ? "" : metadata[0].second);
  }
}

TEST_F(Security, SecretsNeverReachTheLog) {
  const Token token = new_token("planner:solve");
  const std::string wrong = "0123456789abcdef0123456789abcdef";
  start({"--log-level", "debug", "--tokens", write("tokens", token.line)});
  EXPECT_TRUE(ask(bearer(token.secret)).ok());
  const Answer refused = ask(bearer(wrong));
  EXPECT_EQ(refused.status.error_message().find(wrong), std::string::npos);
  EXPECT_FALSE(ask({{"authorization", "Basic " + token.secret}}).ok());
  server().send(SIGHUP);
  ASSERT_TRUE(eventually_logged({"reloaded"}));
  ASSERT_TRUE(eventually_logged({"refused", "unauthenticated"}));
  const std::string hash = token.line.substr(token.line.rfind(':') + 1, 64);
  for (const std::string& secret : {token.secret, wrong, hash})
    EXPECT_EQ(server().log().find(secret), std::string::npos) << server().log();
}

TEST_F(Security, ATokenThatIsOutOfPlaceInItsFileIsNotQuoted) {
  const Token token = new_token("planner:solve");
  const Run reported =
      run({"--check-config", "--tokens", write("tokens", "\n" + token.secret + " planner solve\n")});
  EXPECT_EQ(reported.exit_code, 2);
  EXPECT_TRUE(reported.said("tokens:2: ")) << reported.output;
  EXPECT_FALSE(reported.said(token.secret)) << reported.output;
}

TEST_F(Security, HealthStaysOpenForProbes) {
  start({"--tokens", write("tokens", "# nobody\n")});
  EXPECT_EQ(health(), "SERVING");
  EXPECT_EQ(ask().status.error_code(), StatusCode::UNAUTHENTICATED);
}

TEST_F(Security, ClientsWithoutCredentialsMayNameThemselves) {
  start();
  EXPECT_EQ(ask().info.client(), "127.0.0.1");
  EXPECT_EQ(ask({{"marble-client", "planner"}}).info.client(), "planner");
  const Answer refused = ask({{"marble-client", std::string(65, 'x')}});
  EXPECT_EQ(refused.status.error_code(), StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bad_field(refused.status).field(), "marble-client");
}

TEST_F(Security, CheckConfigLooksIntoTheFiles) {
  const CertificateFiles files = authority_.issue_for_server(), other = authority_.issue_for_server();
  const std::string tokens = write("tokens", new_token("planner:solve").line);
  const auto check = [&](const std::vector<std::string>& flags) {
    std::vector<std::string> all = {"--check-config"};
    all.insert(all.end(), flags.begin(), flags.end());
    return run(all);
  };
  const Run good = check({"--tokens", tokens, "--tls-certificate", files.certificate, "--tls-key", files.key,
                          "--tls-client-ca", clients_.certificate(), "--listen", "0.0.0.0:0"});
  EXPECT_EQ(good.exit_code, 0) << good.output;
  EXPECT_EQ(good.output, "ok\n");
  const std::vector<std::pair<std::vector<std::string>, std::string>> bad = {
      {{"--tokens", directory_.file("none")}, "cannot be read"},
      {{"--tls-certificate", files.certificate}, "tls_key"},
      {{"--tls-certificate", files.certificate, "--tls-key", other.key}, "must be the key of"},
      {{"--tls-certificate", files.certificate, "--tls-key", files.certificate}, "tls_key"},
      {{"--tls-certificate", files.key, "--tls-key", files.key}, "tls_certificate"},
      {{"--tls-client-ca", clients_.certificate()}, "tls_client_ca"},
      {{"--tls-certificate", files.certificate, "--tls-key", files.key, "--tls-client", "require"},
       "needs tls_client_ca"},
      {{"--tls-certificate", files.certificate, "--tls-key", files.key, "--tls-client-ca", tokens},
       "tls_client_ca"}};
  for (const auto& [flags, text] : bad) {
    const Run reported = check(flags);
    EXPECT_EQ(reported.exit_code, 2) << text;
    EXPECT_TRUE(reported.said(text)) << reported.output;
  }
}

TEST_F(Security, NewTokenRefusesWhatIsNoNameOrRole) {
  for (const char* wrong : {"planner", "planner:", "planner:root", ":solve", "two words:solve"})
    EXPECT_EQ(run({"--new-token", wrong}).exit_code, 2) << wrong;
}

}  // namespace
}  // namespace marble::testing
