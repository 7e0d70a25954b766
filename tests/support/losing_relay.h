// Relays between clients and a server, and holds back the server's responses as a failing network does.
#pragma once

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <list>
#include <string>
#include <thread>
#include <vector>

#include "loopback.h"

namespace marble::testing {

class LosingRelay {
 public:
  /// Relays to a server on "127.0.0.1:4711".
  explicit LosingRelay(const std::string& server) : server_(loopback(server)) {
    address_ = "127.0.0.1:" + std::to_string(listen_on(listener_, loopback()));
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  ~LosingRelay() {
    thread_.request_stop();
    thread_.join();
    for (Connection& connection : connections_) hang_up(connection);
    close(listener_);
  }
  LosingRelay(const LosingRelay&) = delete;
  LosingRelay& operator=(const LosingRelay&) = delete;

  [[nodiscard]] const std::string& address() const { return address_; }
  /// Ends the connections that lost a response; later ones get theirs.
  void cut() { loses_ = false; }

 private:
  /// More than the start of a connection, less than the requests whose responses are lost.
  static constexpr std::size_t kRequestBytes = 4000;

  struct Connection {
    int client, server;
    std::size_t asked = 0;
    bool lost = false;
  };

  static void hang_up(const Connection& connection) {
    close(connection.client);
    close(connection.server);
  }

  void accept_one() {
    Connection connection{accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC),
                          socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
    if (connect(connection.server, reinterpret_cast<const sockaddr*>(&server_), sizeof server_) == 0) {
      connections_.push_back(connection);
    } else {
      hang_up(connection);
    }
  }

  /// Passes the data that one end has sent to the other. Returns false once it has closed.
  [[nodiscard]] bool pass(Connection& connection, bool from_client) {
    std::array<char, 1 << 16> bytes;
    const ssize_t count =
        recv(from_client ? connection.client : connection.server, bytes.data(), bytes.size(), 0);
    if (count <= 0) return false;
    if (from_client) {
      connection.asked += static_cast<std::size_t>(count);
      connection.lost = connection.lost || (loses_ && connection.asked > kRequestBytes);
    } else if (connection.lost) {
      return true;
    }
    const int to = from_client ? connection.server : connection.client;
    for (ssize_t sent = 0; sent < count;) {
      const ssize_t now = send(to, bytes.data() + sent, static_cast<std::size_t>(count - sent), MSG_NOSIGNAL);
      if (now <= 0) return false;
      sent += now;
    }
    return true;
  }

  void run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      std::vector<pollfd> ends = {{listener_, POLLIN, 0}};
      for (const Connection& connection : connections_) {
        ends.push_back({connection.client, POLLIN, 0});
        ends.push_back({connection.server, POLLIN, 0});
      }
      poll(ends.data(), ends.size(), 10);
      std::size_t end = 1;
      for (auto connection = connections_.begin(); connection != connections_.end(); end += 2) {
        const bool over = (connection->lost && !loses_) ||
                          (ends[end].revents != 0 && !pass(*connection, true)) ||
                          (ends[end + 1].revents != 0 && !pass(*connection, false));
        if (over) hang_up(*connection);
        connection = over ? connections_.erase(connection) : std::next(connection);
      }
      if (ends[0].revents != 0) accept_one();
    }
  }

  sockaddr_in server_;
  int listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  std::string address_;
  std::atomic<bool> loses_ = true;
  std::list<Connection> connections_;  // used only by the thread
  std::jthread thread_;
};

}  // namespace marble::testing
