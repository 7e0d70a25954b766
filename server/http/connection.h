// One connection of the HTTP port, in the clear or with TLS: what a request may take, in bytes and in time.
#pragma once

#include <httplib.h>

#include <array>
#include <atomic>

#include "http/tls_session.h"
#include "job_record.h"

namespace marble::server::http {

/// One thread at a time. Closes the socket.
class Connection final : public httplib::Stream {
 public:
  static constexpr std::size_t kLongestRequest = 96 << 10;  ///< bytes of line, headers and body
  static constexpr std::chrono::seconds kRequestTime{10};   ///< for all of these
  static constexpr std::chrono::seconds kWriteTime{5};      ///< for each piece of an answer
  static constexpr std::chrono::milliseconds kLinger{500};  ///< for one who sends on after the answer

  /// While `stopping`, nothing is waited for.
  Connection(int socket, const std::atomic<bool>& stopping);
  ~Connection() override;

  /// False if it fails.
  [[nodiscard]] bool shake_hands(TlsSession session);
  /// Waits for the first byte of a request, and measures it from there. False if there is none in time.
  [[nodiscard]] bool wait_for_request(Clock::duration patience);
  /// Reads no more of the request: what is still to come is too much.
  void end_request() {
    left_ = 0;
    lingers_ = true;
  }
  [[nodiscard]] const SSL* session() const { return session_.get(); }

  [[nodiscard]] bool is_readable() const override { return true; }
  [[nodiscard]] bool is_writable() const override { return !stopping_; }
  ssize_t read(char* bytes, std::size_t size) override;
  ssize_t write(const char* bytes, std::size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  /// None: httplib wants it for select(2), which knows no socket beyond 1023.
  [[nodiscard]] socket_t socket() const override { return 0; }

 private:
  [[nodiscard]] bool wait(short events, Clock::time_point until) const;
  [[nodiscard]] bool fill(Clock::time_point until);
  // What OpenSSL waits for after this result, or 0 if it has failed.
  [[nodiscard]] short awaited(int result) const;

  const int socket_;
  const std::atomic<bool>& stopping_;
  TlsSession session_;
  bool shaken_ = false;
  std::array<char, 4096> buffer_ = {};
  std::size_t begin_ = 0, end_ = 0;  // of what is read but not taken
  std::size_t left_ = 0;             // of the request's bytes
  Clock::time_point until_ = {};     // the request must be here
  bool lingers_ = false;             // waits for what still comes
};

}  // namespace marble::server::http
