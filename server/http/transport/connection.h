// One connection of the HTTP port, in the clear or with TLS: what a request may take, in bytes and in time.
#pragma once

#include <httplib.h>
#include <poll.h>

#include <algorithm>
#include <atomic>
#include <string_view>
#include <vector>

#include "http/transport/tls_session.h"
#include "jobs/job_record.h"

namespace marble::server::http {

/// One thread at a time. Closes the socket.
class Connection final : public httplib::Stream {
 public:
  static constexpr std::size_t kLongestRequest = 96 << 10;  ///< bytes of line, headers and body
  static constexpr std::chrono::seconds kRequestTime{10};   ///< for all of these
  static constexpr std::chrono::seconds kIdleTime{5};       ///< from an answer to the next request
  static constexpr std::chrono::seconds kWriteTime{5};      ///< for each piece of an answer
  static constexpr std::chrono::milliseconds kLinger{500};  ///< for one who sends on after the answer

  /// `session` is null in the clear. A request's first line has `line_time` from its first byte, and so have
  /// its body, from its head, and the first byte of a new connection. A client may let the server wait
  /// for kWriteTime while it takes an answer, and for a second for each `answer_rate` bytes of it. Once
  /// `stop` is set, the server waits for no more requests, and until that time for clients to take their
  /// answers.
  Connection(int socket, TlsSession session, Clock::duration line_time, double answer_rate,
             const std::atomic<Clock::time_point>& stop);
  ~Connection() override;

  /// How much of the next request is here: nothing, something, its first line, all but its body.
  enum class Arrival { nothing, begun, line, head, closed };
  /// Takes what has come, without waiting; the handshake comes first.
  [[nodiscard]] Arrival receive();
  /// Until when more of the request must have come.
  [[nodiscard]] Clock::time_point due() const;
  /// What to poll for until then.
  [[nodiscard]] pollfd awaited() const { return {socket_, awaited_, 0}; }
  /// What is here of the request.
  [[nodiscard]] std::string_view received() const { return {buffer_.data() + begin_, end_ - begin_}; }
  /// The request is read from here on; measured from its first byte. How many there have been, with it.
  int begin_request();
  /// The request has a body of so many bytes yet, beyond what requests have, and so much time for it.
  void expect_body(std::size_t bytes, Clock::duration time) {
    left_ = std::max(left_, bytes);
    until_ = std::max(until_, Clock::now() + time);
  }
  /// Bytes that may yet be read of the request.
  [[nodiscard]] std::size_t left() const { return left_; }
  /// It is answered, and the connection waits for the next.
  void await_next();
  /// Reads no more of the request: what is still to come is too much.
  void end_request() {
    left_ = 0;
    lingers_ = true;
  }
  [[nodiscard]] const SSL* session() const { return session_.get(); }

  [[nodiscard]] bool is_readable() const override { return true; }
  [[nodiscard]] bool is_writable() const override { return true; }
  ssize_t read(char* bytes, std::size_t size) override;
  ssize_t write(const char* bytes, std::size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  /// None: httplib wants it for select(2), which knows no socket beyond 1023.
  [[nodiscard]] socket_t socket() const override { return 0; }

 private:
  [[nodiscard]] bool wait(short events, Clock::time_point until) const;
  [[nodiscard]] bool fill(Clock::time_point until);
  // Appends what has come to the buffer. 0: `awaited_` tells for what to wait; negative: there is no more.
  [[nodiscard]] ssize_t take(std::size_t most);
  [[nodiscard]] Arrival arrival();
  // What OpenSSL waits for after this result, or 0 if it has failed.
  [[nodiscard]] short awaited(int result) const;

  const int socket_;
  const std::atomic<Clock::time_point>& stop_;
  const TlsSession session_;
  const Clock::duration line_time_;
  const double answer_rate_;  // bytes/s
  bool shaken_ = false;
  std::vector<char> buffer_;
  std::size_t begin_ = 0, end_ = 0;  // of what is read but not taken
  Arrival arrived_ = Arrival::nothing;
  std::size_t scanned_ = 0;  // of the next request's bytes, but for what may be the begin of an end
  short awaited_ = POLLIN;
  Clock::time_point since_ = Clock::now();  // the last answer, or the connection's begin
  Clock::time_point begun_ = {};            // the request's first byte
  int requests_ = 0;
  std::size_t left_ = 0;                   // of the request's bytes
  Clock::time_point until_ = {};           // the request must be here
  Clock::duration may_wait_ = kWriteTime;  // for the client to take the answer
  bool lingers_ = false;                   // waits for what still comes
};

}  // namespace marble::server::http
