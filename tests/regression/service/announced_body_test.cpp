// Symptom: an HTTP request that announced a body of more than 64 KiB was answered with 413 only after 10 s,
// and held a thread so long, if the body did not come. Cause: httplib reads such a body to its end, or to the
// end of the request's time, before it refuses it.
#include <poll.h>
#include <sys/socket.h>

#include "service/http_service_test.h"

namespace marble::testing {
namespace {

class AnnouncedBody : public HttpServiceTest {
 protected:
  static void send_text(int connection, const std::string& text) {
    EXPECT_EQ(send(connection, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }
  static std::string receive(int connection) {
    char buffer[4096];
    const ssize_t got = recv(connection, buffer, sizeof buffer, 0);
    return {buffer, static_cast<std::size_t>(std::max<ssize_t>(got, 0))};
  }
};

TEST_F(AnnouncedBody, IsRefusedBeforeItComes) {
  start();
  // The other connection is closed for being idle long before a request's time is over.
  const int idle = connected_to(server().http()), announced = connected_to(server().http());
  send_text(idle, "HEAD /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_NE(receive(idle).find(" 200 "), std::string::npos);
  send_text(announced,
            "POST /api/jobs/x/cancel HTTP/1.1\r\nHost: localhost\r\nMarble-Request: 1\r\n"
            "Content-Length: 70000\r\n\r\n");
  pollfd both[] = {{idle, POLLIN, 0}, {announced, POLLIN, 0}};
  ASSERT_GT(poll(both, 2, -1), 0);
  ASSERT_NE(both[1].revents & POLLIN, 0);
  const std::string answer = receive(announced);
  EXPECT_NE(answer.find(" 413 "), std::string::npos) << answer;
  close(idle);
  close(announced);
}

TEST_F(AnnouncedBody, ThatComesAllTheSameDoesNotTearDownTheAnswer) {
  start();
  const auto answer = client().Post("/api/jobs/x/cancel", {{"Marble-Request", "1"}},
                                    std::string(4 << 20, 'x'), "application/json");
  ASSERT_TRUE(answer) << httplib::to_string(answer.error());
  EXPECT_EQ(answer->status, 413);
  EXPECT_EQ(error_of(answer).at("field"), "body");
}

}  // namespace
}  // namespace marble::testing
