// Accepts the gRPC port's connections, hands them to gRPC, and watches them. gRPC 1.51's own listener stops
// accepting forever once the process has run out of descriptors (CVE-2023-4785), and has no limit on
// connections.
#pragma once

#include <grpcpp/server_builder.h>

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "net/connection_table.h"
#include "net/listening_socket.h"

namespace marble::server {

class Acceptor {
 public:
  /// An address, and the server that serves its connections.
  struct Entrance {
    ListeningSocket socket;
    std::shared_ptr<grpc::experimental::ExternalConnectionAcceptor> server;
  };

  /// Starts at once: the servers must have been started. The table must outlive it.
  Acceptor(std::vector<Entrance> entrances, ConnectionTable& connections);
  ~Acceptor();
  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;

  /// Stops accepting, so that new connections are refused, and stops watching. Called before the servers
  /// shut down.
  void stop();
  /// Returns the listening sockets, valid while the acceptor lives.
  [[nodiscard]] std::vector<int> listeners() const;

 private:
  void accept();
  void watch();
  [[nodiscard]] bool accept_all(int listener, grpc::experimental::ExternalConnectionAcceptor& server);
  [[nodiscard]] bool out_of_descriptors(int listener);

  const std::vector<Entrance> entrances_;
  ConnectionTable& connections_;
  const Descriptor stop_, look_;  // eventfds; new sockets to watch, or to stop watching
  Descriptor reserve_;            // released for a moment to refuse a connection
  std::atomic<bool> accepted_all_ = false;
  // Two threads: the one that hands over a connection reads from it before it returns, as long as more
  // arrives.
  std::thread accepting_, watching_;
};

}  // namespace marble::server
