// The HTTP port against other sites' pages, broken requests, and in TLS.
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include "http_service_test.h"

namespace marble::testing {
namespace {

class HttpSecurity : public HttpServiceTest {
 protected:
  [[nodiscard]] int connected() {
    const int one = connected_to(server().http());
    const timeval patience = {30, 0};
    setsockopt(one, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    return one;
  }
  /// Sends bytes as they are and returns all that comes back until the server closes.
  [[nodiscard]] std::string exchange(const std::string& bytes, bool then_close = true) {
    const int one = connected();
    for (std::size_t sent = 0; sent < bytes.size();) {
      const ssize_t now = send(one, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (now <= 0) break;  // the server has seen enough
      sent += static_cast<std::size_t>(now);
    }
    if (then_close) shutdown(one, SHUT_WR);
    std::string answer;
    char buffer[4096];
    for (ssize_t got = recv(one, buffer, sizeof buffer, 0); got > 0;
         got = recv(one, buffer, sizeof buffer, 0))
      answer.append(buffer, static_cast<std::size_t>(got));
    close(one);
    return answer;
  }
  /// The status of an answer to a client with these certificates; 0 if there is no connection.
  [[nodiscard]] int status_of(const TestAuthority& trusted, const CertificateFiles& own = {},
                              std::string* client = nullptr) {
    const std::string url = server().http();
    const int port = std::stoi(url.substr(url.rfind(':') + 1));
    httplib::SSLClient http("127.0.0.1", port, own.certificate, own.key);
    http.set_ca_cert_path(trusted.certificate());
    http.enable_server_certificate_verification(true);
    const auto answer = http.Get("/api/info");
    if (answer && client != nullptr) *client = Json::parse(answer->body).value("client", "");
    return answer ? answer->status : 0;
  }

  TestAuthority authority_, clients_, unauthenticated_;
};

TEST_F(HttpSecurity, EveryAnswerReportsBrowsersToKeepOthersOut) {
  start();
  for (const char* path : {"/", "/assets/chart.js", "/api/info", "/healthz", "/nothing", "/api/jobs/none"}) {
    const auto answer = get(path);
    EXPECT_EQ(answer->get_header_value("X-Content-Type-Options"), "nosniff") << path;
    EXPECT_EQ(answer->get_header_value("X-Frame-Options"), "DENY") << path;
    EXPECT_EQ(answer->get_header_value("Referrer-Policy"), "no-referrer") << path;
    EXPECT_EQ(answer->get_header_value("Cross-Origin-Resource-Policy"), "same-origin") << path;
    EXPECT_NE(answer->get_header_value("Content-Security-Policy").find("default-src 'none'"),
              std::string::npos);
    EXPECT_EQ(answer->get_header_value_count("Cache-Control"), 1U) << path;
    EXPECT_FALSE(answer->has_header("Access-Control-Allow-Origin")) << path;
  }
  EXPECT_EQ(get("/api/info")->get_header_value("Cache-Control"), "no-store");
}

TEST_F(HttpSecurity, AnAssetIsSentOnceAndThenOnlyConfirmed) {
  start();
  const auto first = get("/assets/chart.js");
  ASSERT_EQ(first->status, 200);
  EXPECT_EQ(first->get_header_value("Content-Type"), "text/javascript; charset=utf-8");
  EXPECT_EQ(first->get_header_value("Cache-Control"), "no-cache");
  const auto second = get("/assets/chart.js", {{"If-None-Match", first->get_header_value("ETag")}});
  EXPECT_EQ(second->status, 304);
  EXPECT_TRUE(second->body.empty());
}

TEST_F(HttpSecurity, AnotherSitesNameForThisHostIsRefused) {
  start();
  for (const char* host : {"localhost:50080", "127.0.0.1", "127.1.2.3:80", "[::1]:50080", "LOCALHOST"})
    EXPECT_EQ(get("/api/info", {{"Host", host}})->status, 200) << host;
  for (const char* host : {"evil.example", "127.evil.example", "localhost.evil.example:50080"}) {
    const auto answer = get("/api/info", {{"Host", host}});
    EXPECT_EQ(answer->status, 403) << host;
    EXPECT_EQ(error_of(answer).at("field"), "Host");
  }
  EXPECT_TRUE(eventually_logged({"refused", "evil.example"}));
}

TEST_F(HttpSecurity, ATokenProvesMoreThanAName) {
  const Token token = new_token("viewer:observe");
  start({"--tokens", write("tokens", token.line)});
  auto headers = bearer_header(token.secret);
  headers.emplace("Host", "dashboard.example");
  EXPECT_EQ(get("/api/info", headers)->status, 200);
}

TEST_F(HttpSecurity, AnotherSitesPageCannotActOrAsk) {
  start();
  const std::string id = submit(long_request());
  const auto form = client().Post("/api/jobs/" + id + "/cancel", "", "application/x-www-form-urlencoded");
  EXPECT_EQ(form->status, 403);
  EXPECT_EQ(error_of(form).at("field"), "Marble-Request");
  EXPECT_EQ(get("/api/jobs", {{"Sec-Fetch-Site", "cross-site"}})->status, 403);
  EXPECT_EQ(get("/api/jobs", {{"Sec-Fetch-Site", "same-origin"}})->status, 200);
  EXPECT_NE(job(id).job().state(), v1::JOB_STATE_FINISHED);
  EXPECT_EQ(cancel(id)->status, 200);
}

TEST_F(HttpSecurity, BrokenRequestsAreAnsweredOrClosedAndTheServerLives) {
  start();
  const std::string host = "Host: localhost\r\n";
  EXPECT_NE(exchange("garbage\r\n\r\n").find(" 400 "), std::string::npos);
  EXPECT_NE(exchange(std::string("\0\xff\r\n\r\n", 6)).find(" 400 "), std::string::npos);
  EXPECT_NE(exchange("GET /" + std::string(9000, 'a') + " HTTP/1.1\r\n" + host + "\r\n").find(" 414 "),
            std::string::npos);
  EXPECT_NE(exchange("POST /api/jobs/x/cancel HTTP/1.1\r\n" + host +
                     "Marble-Request: 1\r\nContent-Length: 99999999999\r\n\r\n")
                .find(" 413 "),
            std::string::npos);
  EXPECT_NE(
      exchange("POST /api/jobs/x/cancel HTTP/1.1\r\n" + host + "Marble-Request: 1\r\n\r\n").find(" 404 "),
      std::string::npos)
      << "no length means no body";
  EXPECT_EQ(exchange("GET /api/in").find(" 200 "), std::string::npos);
  EXPECT_EQ(exchange("GET " + std::string(1 << 20, 'a'), false).find(" 200 "), std::string::npos);
  std::string many;
  for (int i = 0; i < 20'000; ++i) many += "X-" + std::to_string(i) + ": y\r\n";
  EXPECT_EQ(exchange("GET /api/info HTTP/1.1\r\n" + host + many + "\r\n", false).find(" 200 "),
            std::string::npos);
  for (const char* id : {"%00", "%2e%2e%2fx", "%ff%fe", "%", "%zz", "%22%0d%0aX:%20y", "..%2f..%2fetc"}) {
    const std::string answer =
        exchange("GET /api/jobs/" + std::string(id) + "/trace.csv HTTP/1.1\r\n" + host + "\r\n");
    EXPECT_NE(answer.find(" 404 "), std::string::npos) << id << "\n" << answer;
  }
  EXPECT_EQ(get("/api/info")->status, 200);
  EXPECT_TRUE(lives());
}

TEST_F(HttpSecurity, ABodyIsNoSecondRequest) {
  start();
  const std::string answer = exchange(
      "POST /api/jobs/x/cancel HTTP/1.1\r\nHost: localhost\r\nContent-Length: 44\r\n\r\n"
      "GET /api/info HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_NE(answer.find(" 403 "), std::string::npos) << answer;
  EXPECT_EQ(answer.find(" 200 "), std::string::npos) << answer;
}

TEST_F(HttpSecurity, TlsIsThatOfGrpc) {
  start(tls_flags(authority_.issue_for_server()));
  EXPECT_EQ(server().http().rfind("https://", 0), 0U);
  EXPECT_EQ(status_of(authority_), 200);
  EXPECT_EQ(status_of(unauthenticated_), 0);
  EXPECT_EQ(exchange("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").find(" 200 "), std::string::npos);
}

TEST_F(HttpSecurity, ACertificateNamesItsClientAsInGrpc) {
  auto flags = tls_flags(authority_.issue_for_server());
  flags.insert(flags.end(), {"--tls-client-ca", clients_.certificate()});
  start(flags);
  const auto name_by = [&](const std::string& common_name, const std::string& alternatives) {
    std::string client;
    EXPECT_EQ(status_of(authority_, clients_.issue(common_name, alternatives), &client), 200);
    return client;
  };
  EXPECT_EQ(name_by("somebody", "URI:spiffe://example/x,DNS:planner.example"), "cert:planner.example");
  EXPECT_EQ(name_by("somebody", "URI:spiffe://example/planner"), "cert:spiffe://example/planner");
  EXPECT_EQ(name_by("planner", ""), "cert:planner");
  EXPECT_EQ(status_of(authority_), 0) << "no certificate";
  EXPECT_EQ(status_of(authority_, unauthenticated_.issue("planner", "")), 0) << "of another authority";
  EXPECT_EQ(status_of(authority_, clients_.issue("planner", "", -1)), 0) << "expired";
}

TEST_F(HttpSecurity, RenewedCertificatesCountAndBrokenOnesDoNot) {
  const CertificateFiles files = authority_.issue_for_server(), renewed = unauthenticated_.issue_for_server();
  start(tls_flags(files));
  EXPECT_EQ(status_of(authority_), 200);
  const auto over = std::filesystem::copy_options::overwrite_existing;
  std::filesystem::copy_file(renewed.certificate, files.certificate, over);
  EXPECT_EQ(status_of(authority_), 200) << "the key does not fit yet";
  std::filesystem::copy_file(renewed.key, files.key, over);
  EXPECT_EQ(status_of(unauthenticated_), 200) << server().log();
  EXPECT_EQ(status_of(authority_), 0);
}

TEST_F(HttpSecurity, EventsComeOverTlsAndTheServerEndsThem) {
  start(tls_flags(authority_.issue_for_server()));
  const std::string url = server().http();
  httplib::SSLClient http("127.0.0.1", std::stoi(url.substr(url.rfind(':') + 1)));
  http.enable_server_certificate_verification(false);
  std::atomic<std::size_t> bytes = 0;
  std::jthread reader([&] {
    const auto ended = http.Get("/api/events", [&](const char*, std::size_t size) {
      bytes += size;
      return true;
    });
  });
  EXPECT_TRUE(eventually([&] { return bytes > 1000; }));
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(HttpSecurity, ALongProblemComesOverTlsToo) {
  start(tls_flags(authority_.issue_for_server()));
  const std::string url = server().http();
  httplib::SSLClient http("127.0.0.1", std::stoi(url.substr(url.rfind(':') + 1)));
  http.enable_server_certificate_verification(false);
  const Json problem = {{"n", 1},
                        {"g", {1}},
                        {"C", {{"rows", 1}, {"cols", 1}, {"i", {0}}, {"j", {0}}, {"v", {1}}}},
                        {"d", {0}},
                        {"pad", std::string(1 << 20, 'x')}};
  const auto answer = http.Post("/api/jobs", problem.dump(), "application/json");
  ASSERT_TRUE(answer) << httplib::to_string(answer.error());
  EXPECT_EQ(answer->status, 202) << answer->body;
}

}  // namespace
}  // namespace marble::testing
