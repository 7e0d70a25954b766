// Symptom: on a server with tokens and TLS on 0.0.0.0, the configuration file became empty (a full disk, an
// editor, a template) and SIGHUP came: everybody had every role. The same server without tokens started
// without a word. A certificate for DNS:alice read the jobs of the token alice, and a wrong token beside a
// good certificate was let in. Cause: a reload took whatever it read; TLS alone counted as safe; names of
// certificates and tokens were one set; a token that is not known was as good as none.
#include "service/http_service_test.h"

namespace marble::testing {
namespace {

using grpc::StatusCode;

class OpenAccess : public HttpServiceTest {
 protected:
  /// Starts a server with TLS that takes certificates of clients_ and tokens.
  void start_with_both(const std::string& tokens, std::vector<std::string> flags = {}) {
    const auto own = tls_flags(authority_.issue_for_server());
    flags.insert(flags.end(), own.begin(), own.end());
    flags.insert(flags.end(), {"--tls-client-ca", clients_.certificate(), "--tls-client", "request",
                               "--tokens", write("tokens", tokens)});
    start(flags);
  }
  std::shared_ptr<grpc::Channel> channel_as(const CertificateFiles& own) {
    return grpc::CreateChannel(server().address(), tls(authority_, own));
  }
  Run check(std::vector<std::string> flags) {
    flags.insert(flags.begin(), "--check-config");
    return run(flags);
  }

  TestAuthority authority_, clients_;
};

TEST_F(OpenAccess, AReloadThatLosesTheTokensLetsNobodyIn) {
  const Token token = new_token("planner:solve");
  write("tokens", token.line);
  write("config.toml", "client_queued = 7\ntokens = \"" + directory_.file("tokens") + "\"\n");
  start({"--config", directory_.file("config.toml")});
  write("config.toml", "");
  server().send(SIGHUP);
  ASSERT_TRUE(eventually_logged({"reload_refused", "config.toml:2", "tokens are gone"})) << server().log();
  EXPECT_EQ(ask().status.error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(ask(bearer(token.secret)).info.limits().quota().queued(), 7) << "nothing else has changed either";
  std::filesystem::remove(directory_.file("tokens"));
  write("config.toml", "tokens = \"" + directory_.file("tokens") + "\"\n");
  server().send(SIGHUP);
  ASSERT_TRUE(eventually_logged({"reload_refused", "cannot be read"})) << server().log();
  EXPECT_EQ(ask().status.error_code(), StatusCode::UNAUTHENTICATED);
}

TEST_F(OpenAccess, AReloadMayStillReportCallersApart) {
  write("config.toml", "");
  start({"--config", directory_.file("config.toml")});
  EXPECT_TRUE(ask().ok());
  const Token token = new_token("planner:solve");
  write("config.toml", "tokens = \"" + write("tokens", token.line) + "\"\n");
  server().send(SIGHUP);
  ASSERT_TRUE(eventually_logged({" reloaded ", "tokens"})) << server().log();
  EXPECT_EQ(ask().status.error_code(), StatusCode::UNAUTHENTICATED);
}

TEST_F(OpenAccess, BeyondLoopbackCallersAreKnownOrAnyoneIsSaid) {
  const auto own = tls_flags(authority_.issue_for_server());
  const auto with_tls = [&](std::vector<std::string> flags) {
    flags.insert(flags.end(), own.begin(), own.end());
    return check(flags);
  };
  const std::string anywhere = "0.0.0.0:0", tokens = write("tokens", new_token("planner:solve").line);
  for (const Run& refused : {with_tls({"--listen", anywhere}), with_tls({"--http", anywhere}),
                             check({"--listen", anywhere, "--insecure"})}) {
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_TRUE(refused.said("every caller has every role")) << refused.output;
    EXPECT_TRUE(refused.said("--allow-anonymous")) << refused.output;
  }
  for (const Run& taken : {with_tls({"--listen", anywhere, "--tokens", tokens}),
                           with_tls({"--listen", anywhere, "--tls-client-ca", clients_.certificate()}),
                           with_tls({"--listen", anywhere, "--allow-anonymous"}),
                           check({"--listen", anywhere, "--insecure", "--allow-anonymous"}),
                           check({"--listen", anywhere, "--insecure", "--tokens", tokens}), check({})}) {
    EXPECT_EQ(taken.exit_code, 0) << taken.output;
  }
}

TEST_F(OpenAccess, WhoLetsAnyoneInIsWarnedAtEachStart) {
  start({"--listen", "0.0.0.0:0", "--insecure", "--allow-anonymous"});
  EXPECT_TRUE(eventually_logged({" warning allow_anonymous component=access", "0.0.0.0"})) << server().log();
  start({"--listen", "0.0.0.0:0", "--insecure", "--allow-anonymous", "--tokens", write("tokens", "")});
  ASSERT_TRUE(eventually_logged({" listening "}));  // which comes later
  EXPECT_TRUE(server().log_lines({" allow_anonymous "}).empty()) << server().log();
}

TEST_F(OpenAccess, ACertificateWithATokensNameIsSomebodyElse) {
  const Token alice = new_token("alice:solve");
  const std::string file = write("config.toml", "[clients.alice]\nroles = [\"solve\"]\n");
  start_with_both(alice.line, {"--config", file});
  const auto jobs = v1::Jobs::NewStub(channel_as({}));
  grpc::ClientContext submitting;
  submitting.AddMetadata("authorization", "Bearer " + alice.secret);
  v1::SubmitResponse submitted;
  ASSERT_TRUE(jobs->Submit(&submitting, example_request(), &submitted).ok());
  const CertificateFiles same_name = clients_.issue("somebody", "DNS:alice");
  EXPECT_EQ(ask(tls(authority_, same_name)).info.client(), "cert:alice");
  const auto other = v1::Jobs::NewStub(channel_as(same_name));
  grpc::ClientContext looking, fetching, deleting;
  v1::GetJobRequest shown;
  shown.set_job_id(submitted.job_id());
  v1::GetJobResponse job;
  EXPECT_EQ(other->Get(&looking, shown, &job).error_code(), StatusCode::NOT_FOUND);
  v1::JobResultRequest wanted;
  wanted.set_job_id(submitted.job_id());
  wanted.set_wait(true);
  v1::SolveResponse result;
  EXPECT_EQ(other->Result(&fetching, wanted, &result).error_code(), StatusCode::NOT_FOUND);
  v1::DeleteJobRequest unwanted;
  unwanted.set_job_id(submitted.job_id());
  v1::DeleteJobResponse deleted;
  EXPECT_EQ(other->Delete(&deleting, unwanted, &deleted).error_code(), StatusCode::NOT_FOUND);
}

TEST_F(OpenAccess, ATableOfAClientIsOfBothUnlessItNamesTheCertificate) {
  const Token alice = new_token("alice:solve");
  const std::string file = write("config.toml",
                                 "[clients.alice]\nqueued = 3\nroles = [\"solve\"]\n"
                                 "[clients.\"cert:bob\"]\nqueued = 4\nroles = [\"admin\"]\n"
                                 "[clients.bob]\nqueued = 5\n");
  const Token bob = new_token("bob:solve");
  start_with_both(alice.line + bob.line, {"--config", file});
  const auto as = [&](const std::string& name) { return ask(tls(authority_, clients_.issue(name, ""))); };
  EXPECT_EQ(ask(tls(authority_), bearer(alice.secret)).info.limits().quota().queued(), 3);
  EXPECT_EQ(as("alice").info.limits().quota().queued(), 3);
  EXPECT_EQ(as("alice").roles(), std::vector<std::string>{"solve"});
  EXPECT_EQ(ask(tls(authority_), bearer(bob.secret)).info.limits().quota().queued(), 5);
  EXPECT_EQ(as("bob").info.limits().quota().queued(), 4);
  EXPECT_EQ(as("bob").roles(), std::vector<std::string>{"admin"});
}

TEST_F(OpenAccess, NoTokenHasACertificatesName) {
  const Run made = run({"--new-token", "cert:alice:solve"});
  EXPECT_EQ(made.exit_code, 2);
  EXPECT_TRUE(made.said("must not begin with cert:")) << made.output;
}

TEST_F(OpenAccess, AWrongTokenIsRefusedWhateverElseIsShown) {
  const Token alice = new_token("alice:solve");
  start_with_both(alice.line);
  const auto good = tls(authority_, clients_.issue("planner", ""));
  EXPECT_TRUE(ask(good).ok());
  EXPECT_EQ(ask(good, bearer(alice.secret)).info.client(), "alice");
  EXPECT_EQ(ask(good, bearer("wrong")).status.error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(ask(good, bearer("")).status.error_code(), StatusCode::UNAUTHENTICATED);
  Metadata two = bearer(alice.secret);
  two.push_back(two.front());
  EXPECT_EQ(ask(good, two).status.error_code(), StatusCode::UNAUTHENTICATED) << "which of them counts?";
  const CertificateFiles planner = clients_.issue("planner", "");
  const std::string& url = server().http();
  httplib::SSLClient http("127.0.0.1", std::stoi(url.substr(url.rfind(':') + 1)), planner.certificate,
                          planner.key);
  http.set_ca_cert_path(authority_.certificate());
  EXPECT_EQ(http.Get("/api/info")->status, 200);
  EXPECT_EQ(http.Get("/api/info", bearer_header("wrong"))->status, 401);
}

}  // namespace
}  // namespace marble::testing
