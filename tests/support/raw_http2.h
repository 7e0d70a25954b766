// Provides an HTTP/2 connection frame by frame, for data that no client library would send.
#pragma once

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "child_process.h"
#include "loopback.h"

namespace marble::testing {

class RawHttp2 {
 public:
  enum Frame : std::uint8_t {
    kData = 0,
    kHeaders = 1,
    kReset = 3,
    kSettings = 4,
    kPing = 6,
    kContinuation = 9
  };
  enum Flag : std::uint8_t { kNone = 0, kEndStream = 1, kAck = 1, kEndHeaders = 4 };
  using Fields = std::vector<std::pair<std::string, std::string>>;

  /// A TCP connection to "127.0.0.1:4711" on which nothing has been sent yet.
  explicit RawHttp2(const std::string& address) : socket_(connected_to(address)) {}
  ~RawHttp2() { close(socket_); }
  RawHttp2(const RawHttp2&) = delete;
  RawHttp2& operator=(const RawHttp2&) = delete;

  /// Returns false once the other side has closed.
  bool send(const std::string& bytes) {
    sending_ = true;
    const bool sent = send_all(bytes);
    sending_ = false;
    answer();
    return sent;
  }
  /// `answers`: respond to settings and pings from now on, between sends.
  bool begin(bool answers = true) {
    answers_ = answers;
    return send("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + frame(kSettings, kNone, 0, ""));
  }

  static std::string frame(Frame type, std::uint8_t flags, std::uint32_t stream, const std::string& payload) {
    std::string bytes = number(static_cast<std::uint32_t>(payload.size()), 3);
    bytes += static_cast<char>(type);
    bytes += static_cast<char>(flags);
    return bytes + number(stream, 4) + payload;
  }
  /// Encodes fields in HPACK's plainest form: literal, without index and Huffman code; at most 126 bytes
  /// each.
  static std::string fields(const Fields& all) {
    std::string bytes;
    for (const auto& [name, value] : all) {
      bytes += '\0';
      for (const std::string& text : {name, value}) bytes += static_cast<char>(text.size()) + text;
    }
    return bytes;
  }
  static std::string call_fields(const std::string& path, const Fields& more = {}) {
    Fields all = {{":method", "POST"}, {":scheme", "http"}, {":path", path},
                  {":authority", "l"}, {"te", "trailers"},  {"content-type", "application/grpc"}};
    all.insert(all.end(), more.begin(), more.end());
    return fields(all);
  }
  /// Frames a message as gRPC does. `size` may be larger than the content.
  static std::string message(const std::string& bytes, std::uint32_t size) {
    return '\0' + number(size, 4) + bytes;
  }
  static std::string message(const std::string& bytes) {
    return message(bytes, static_cast<std::uint32_t>(bytes.size()));
  }

  /// Opens a stream and sends the call's headers; the caller sends the message.
  bool call(std::uint32_t stream, const std::string& path, const Fields& more = {}) {
    return send(frame(kHeaders, kEndHeaders, stream, call_fields(path, more)));
  }

  /// Waits until the server has ended the stream, or the connection.
  [[nodiscard]] bool eventually_ended(std::uint32_t stream) {
    return eventually([&] {
      take();
      return closed_ || ended_.count(stream) != 0;
    });
  }
  /// Waits until the server has responded on the stream in any way, or ended the connection.
  [[nodiscard]] bool eventually_answered(std::uint32_t stream) {
    return eventually([&] {
      take();
      return closed_ || answered_.count(stream) != 0;
    });
  }
  [[nodiscard]] bool eventually_closed() {
    return eventually([&] {
      take();
      return closed_;
    });
  }
  [[nodiscard]] bool is_closed() {
    take();
    return closed_;
  }

 private:
  bool send_all(const std::string& bytes) {
    std::size_t sent = 0;
    while (sent < bytes.size()) {
      const ssize_t count =
          ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (count > 0) {
        sent += static_cast<std::size_t>(count);
      } else if (errno == EAGAIN) {
        take();  // or both sides would wait for each other
        if (closed_) return false;
        pollfd writable = {socket_, POLLOUT | POLLIN, 0};
        poll(&writable, 1, 1000);
      } else {
        closed_ = true;
        return false;
      }
    }
    return true;
  }
  void answer() {
    if (answers_ && !owed_.empty()) ::send(socket_, owed_.data(), owed_.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    owed_.clear();
  }

  static std::string number(std::uint32_t value, int bytes) {
    std::string result;
    for (int i = bytes - 1; i >= 0; --i) result += static_cast<char>((value >> (8 * i)) & 0xFFU);
    return result;
  }

  // Reads the available data, without waiting.
  void take() {
    char bytes[1 << 16];
    while (!closed_) {
      const ssize_t count = recv(socket_, bytes, sizeof bytes, MSG_DONTWAIT);
      if (count > 0) {
        incoming_.append(bytes, static_cast<std::size_t>(count));
      } else if (count < 0 && errno == EAGAIN) {
        break;
      } else {
        closed_ = true;
      }
    }
    const auto byte = [&](std::size_t at) { return static_cast<std::uint8_t>(incoming_[at]); };
    while (incoming_.size() >= 9) {
      const std::size_t size = (std::size_t{byte(0)} << 16U) | (std::size_t{byte(1)} << 8U) | byte(2);
      if (incoming_.size() < 9 + size) break;
      const std::uint32_t stream = (static_cast<std::uint32_t>(byte(5)) << 24U) |
                                   (static_cast<std::uint32_t>(byte(6)) << 16U) |
                                   (static_cast<std::uint32_t>(byte(7)) << 8U) | byte(8);
      const bool ends =
          byte(3) == kReset || ((byte(3) == kHeaders || byte(3) == kData) && (byte(4) & kEndStream));
      if (ends) ended_.insert(stream);
      if (ends || byte(3) == kHeaders || byte(3) == kData) answered_.insert(stream);
      if (byte(3) == kSettings && (byte(4) & kAck) == 0) owed_ += frame(kSettings, kAck, 0, "");
      if (byte(3) == kPing && (byte(4) & kAck) == 0)
        owed_ += frame(kPing, kAck, 0, incoming_.substr(9, size));
      incoming_.erase(0, 9 + size);
    }
    if (!sending_) answer();  // not in the middle of a frame
  }

  const int socket_;
  bool answers_ = false, sending_ = false, closed_ = false;
  std::string incoming_, owed_;
  std::set<std::uint32_t> ended_, answered_;
};

/// Returns a process's memory in bytes: "VmRSS" current, "VmHWM" its maximum so far.
[[nodiscard]] inline std::int64_t resident_bytes(pid_t pid, const std::string& which = "VmHWM") {
  std::istringstream lines(read_file("/proc/" + std::to_string(pid) + "/status"));
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(which + ":", 0) == 0) return 1024 * std::stoll(line.substr(which.size() + 1));
  }
  return -1;
}

}  // namespace marble::testing
