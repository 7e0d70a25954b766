// Takes the address of a server that was lost: accepts connections, and closes them at once.
#pragma once

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <string>
#include <thread>

#include "child_process.h"
#include "loopback.h"

namespace marble::testing {

class AbsentServer {
 public:
  /// Of a server that was on "127.0.0.1:4711".
  explicit AbsentServer(const std::string& address) {
    const int reuse = 1;
    setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof reuse);
    listen_on(listener_, loopback(address));
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  ~AbsentServer() {
    thread_.request_stop();
    thread_.join();
    close(listener_);
  }
  AbsentServer(const AbsentServer&) = delete;
  AbsentServer& operator=(const AbsentServer&) = delete;

  /// Waits until clients have connected so often. False if that takes too long.
  [[nodiscard]] bool was_sought(int times) const {
    return eventually([&] { return connections_ >= times; });
  }

 private:
  void run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      std::array ends = {pollfd{listener_, POLLIN, 0}};
      if (poll(ends.data(), ends.size(), 10) <= 0) continue;
      close(accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC));
      ++connections_;
    }
  }

  const int listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  std::atomic<int> connections_ = 0;
  std::jthread thread_;
};

}  // namespace marble::testing
