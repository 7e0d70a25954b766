// A connection of the HTTP port, with or without TLS: limits on a request in bytes and in time.
#pragma once

#include <httplib.h>
#include <poll.h>

#include <algorithm>
#include <atomic>
#include <string_view>
#include <vector>

#include "http/tls_session.h"
#include "jobs/job_record.h"

namespace marble::server::http {

/// Used by one thread at a time. Closes the socket.
class Connection final : public httplib::Stream {
 public:
  static constexpr std::size_t kLongestRequest = 96 << 10;  ///< bytes of line, headers and body
  static constexpr std::chrono::seconds kRequestTime{10};   ///< limit for all of these
  static constexpr std::chrono::seconds kIdleTime{5};       ///< time from a reply to the next request
  static constexpr std::chrono::seconds kWriteTime{5};      ///< time for each piece of a reply
  static constexpr std::chrono::milliseconds kLinger{500};  ///< time for a client that still sends

  /// `session` is null without TLS. A request's first line has `line_time` from its first byte, and so have
  /// its body, from its head, and the first byte of a new connection. A client may make the server wait for
  /// kWriteTime while it reads a reply, and for a second for each `answer_rate` bytes of it. Once `stop` is
  /// set, the server waits for no more requests, and until that time for clients to read their replies.
  Connection(int socket, TlsSession session, Clock::duration line_time, double answer_rate,
             const std::atomic<Clock::time_point>& stop);
  ~Connection() override;

  /// How much of the next request has arrived: nothing, something, its first line, all except its body.
  enum class Arrival { nothing, begun, line, head, closed };
  /// Reads what has arrived, without waiting; the handshake comes first.
  [[nodiscard]] Arrival receive();
  /// Returns the time until which more of the request must arrive.
  [[nodiscard]] Clock::time_point due() const;
  /// Returns what to poll for until then.
  [[nodiscard]] pollfd awaited() const { return {socket_, awaited_, 0}; }
  /// Returns the part of the request that has arrived.
  [[nodiscard]] std::string_view received() const { return {buffer_.data() + begin_, end_ - begin_}; }
  /// The request is read from here on; limits count from its first byte. Returns the number of requests so
  /// far, including this one.
  int begin_request();
  /// Allows the request a body of this many more bytes, beyond the usual limit, and this much time for it.
  void expect_body(std::size_t bytes, Clock::duration time) {
    left_ = std::max(left_, bytes);
    until_ = std::max(until_, Clock::now() + time);
  }
  /// Number of bytes of the request that may still be read.
  [[nodiscard]] std::size_t left() const { return left_; }
  /// The request has its reply, and the connection waits for the next.
  void await_next();
  /// Stops reading the request: what follows is too much.
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
  /// None: httplib needs it for select(2), which cannot use a socket beyond 1023.
  [[nodiscard]] socket_t socket() const override { return 0; }

 private:
  [[nodiscard]] bool wait(short events, Clock::time_point until) const;
  [[nodiscard]] bool fill(Clock::time_point until);
  // Appends arrived data to the buffer. 0: `awaited_` is what to wait for; negative: there is no more.
  [[nodiscard]] ssize_t take(std::size_t most);
  [[nodiscard]] Arrival arrival();
  // Returns what OpenSSL waits for after this result, or 0 if it has failed.
  [[nodiscard]] short awaited(int result) const;

  const int socket_;
  const std::atomic<Clock::time_point>& stop_;
  const TlsSession session_;
  const Clock::duration line_time_;
  const double answer_rate_;  // bytes/s
  bool shaken_ = false;
  std::vector<char> buffer_;
  std::size_t begin_ = 0, end_ = 0;  // data that is read but not used
  Arrival arrived_ = Arrival::nothing;
  std::size_t scanned_ = 0;  // bytes of the next request, except a possible start of an end
  short awaited_ = POLLIN;
  Clock::time_point since_ = Clock::now();  // the last reply, or the connection's start
  Clock::time_point begun_ = {};            // the request's first byte
  int requests_ = 0;
  std::size_t left_ = 0;                   // bytes of the request still allowed
  Clock::time_point until_ = {};           // time by which the request must be complete
  Clock::duration may_wait_ = kWriteTime;  // time for the client to read the reply
  bool lingers_ = false;                   // waits for data that still arrives
};

}  // namespace marble::server::http
