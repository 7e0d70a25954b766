// 700 connections to the HTTP port that sent half a line, renewed every 9 s, and /healthz took 8 s: an
// orchestrator that gives a probe a second takes a healthy server for a dead one.
//
// Each connection held a thread from its first moment until its request was there, ten seconds long, and
// probes waited for a thread like everything else.
#include <sys/socket.h>
#include <unistd.h>

#include "service/http_service_test.h"

namespace marble::testing {
namespace {

class HttpProbes : public HttpServiceTest {
 protected:
  /// A connection that has sent this and then nothing.
  class Half {
   public:
    Half(const std::string& url, const std::string& begin) : socket_(connected_to(url)) {
      EXPECT_EQ(send(socket_, begin.data(), begin.size(), MSG_NOSIGNAL), static_cast<ssize_t>(begin.size()));
    }
    ~Half() { close(socket_); }
    Half(const Half&) = delete;
    Half& operator=(const Half&) = delete;
    /// Waits until the server closes it.
    [[nodiscard]] bool ends() const {
      char byte = 0;
      return recv(socket_, &byte, 1, 0) <= 0;
    }

   private:
    const int socket_;
  };
};

// They would be there for an hour.
TEST_F(HttpProbes, HalfRequestsHoldNoThreadAndDelayNobody) {
  start({"--http-connections", "8", "--http-line-s", "3600"});
  std::vector<std::unique_ptr<Half>> halves;
  for (int i = 0; i < 300; ++i)
    halves.push_back(std::make_unique<Half>(server().http(), i % 2 == 0 ? "GET /" : ""));
  EXPECT_EQ(get("/healthz")->status, 200);
  EXPECT_EQ(get("/readyz")->status, 200);
  EXPECT_EQ(get("/api/info")->status, 200);
  EXPECT_TRUE(halves.front()->ends()) << "the oldest leave room for those that ask";
}

TEST_F(HttpProbes, AConnectionThatAsksNothingInTimeIsClosed) {
  start({"--http-line-s", "0.1"});
  EXPECT_TRUE(Half(server().http(), "").ends());
  EXPECT_TRUE(Half(server().http(), "GET /healthz").ends());
  EXPECT_EQ(get("/healthz")->status, 200);
}

TEST_F(HttpProbes, AConnectionThatStaysIsServedAgainAndAgain) {
  start({"--http-line-s", "0.5"});
  auto browser = client();
  browser.set_keep_alive(true);
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(browser.Get("/healthz")->status, 200);
    EXPECT_EQ(browser.Get("/api/info")->status, 200);
  }
}

TEST_F(HttpProbes, HalfHandshakesDelayNobodyEither) {
  TestAuthority authority;
  std::vector<std::string> flags = tls_flags(authority.issue_for_server());
  flags.insert(flags.end(), {"--http-connections", "8", "--http-line-s", "3600"});
  start(flags);
  const std::string url = server().http();
  std::vector<std::unique_ptr<Half>> halves;
  for (int i = 0; i < 50; ++i)
    halves.push_back(std::make_unique<Half>(url, i % 2 == 0 ? "\x16\x03\x01" : ""));
  httplib::SSLClient http("127.0.0.1", std::stoi(url.substr(url.rfind(':') + 1)));
  http.enable_server_certificate_verification(false);
  EXPECT_EQ(http.Get("/healthz")->status, 200);
  EXPECT_EQ(http.Get("/api/info")->status, 200);
}

}  // namespace
}  // namespace marble::testing
