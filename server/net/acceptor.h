// Accepts the gRPC port's connections, hands them to gRPC, and has them watched. gRPC 1.51's own listener
// never accepts again once the process has run out of descriptors (CVE-2023-4785), and knows no limit of
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
  /// An address, and who serves its connections.
  struct Entrance {
    ListeningSocket socket;
    std::shared_ptr<grpc::experimental::ExternalConnectionAcceptor> server;
  };

  /// Starts at once: the servers must have been started. The table must outlive it.
  Acceptor(std::vector<Entrance> entrances, ConnectionTable& connections);
  ~Acceptor();
  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;

  /// Accepts no more, and whoever tries is refused; watches no more. Before the servers shut down.
  void stop();
  /// The sockets that are listened on, for as long as the acceptor lives.
  [[nodiscard]] std::vector<int> listeners() const;

 private:
  void accept();
  void watch();
  [[nodiscard]] bool accept_all(int listener, grpc::experimental::ExternalConnectionAcceptor& server);
  [[nodiscard]] bool out_of_descriptors(int listener);

  const std::vector<Entrance> entrances_;
  ConnectionTable& connections_;
  const Descriptor stop_, look_;  // eventfds; there is somebody to look at, or to be looked at no more
  Descriptor reserve_;            // given up for a moment to turn somebody away
  std::atomic<bool> accepted_all_ = false;
  // Two: who is handed a connection reads from it before it returns, for as long as more keeps coming.
  std::thread accepting_, watching_;
};

}  // namespace marble::server
