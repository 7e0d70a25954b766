#include "net/acceptor.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>

namespace marble::server {
namespace {

constexpr std::chrono::milliseconds kPeriod{25};  // a connection brings about ten megabytes meanwhile
constexpr int kMostAtOnce = 64;                   // from one address, before the others have their turn

Descriptor spare() { return Descriptor(open("/dev/null", O_RDONLY | O_CLOEXEC)); }

bool is_shortage(int error) {
  return error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM;
}

}  // namespace

Acceptor::Acceptor(std::vector<Entrance> entrances, ConnectionTable& connections)
    : entrances_(std::move(entrances)),
      connections_(connections),
      stop_(eventfd(0, EFD_CLOEXEC)),
      look_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      reserve_(spare()),
      accepting_([this] { accept(); }),
      watching_([this] { watch(); }) {}

Acceptor::~Acceptor() { stop(); }

void Acceptor::stop() {
  if (!accepting_.joinable()) return;
  eventfd_write(stop_.get(), 1);
  accepting_.join();  // not delayed for long: the watching thread closes flooding connections
  accepted_all_ = true;
  eventfd_write(look_.get(), 1);
  watching_.join();
  for (const Entrance& entrance : entrances_) {
    for (const Descriptor& socket : entrance.socket.sockets()) shutdown(socket.get(), SHUT_RDWR);
  }
}

std::vector<int> Acceptor::listeners() const {
  std::vector<int> result;
  for (const Entrance& entrance : entrances_) {
    for (const Descriptor& socket : entrance.socket.sockets()) result.push_back(socket.get());
  }
  return result;
}

void Acceptor::accept() {
  std::vector<pollfd> waited = {{stop_.get(), POLLIN, 0}};
  std::vector<grpc::experimental::ExternalConnectionAcceptor*> servers = {nullptr};
  for (const Entrance& entrance : entrances_) {
    for (const Descriptor& socket : entrance.socket.sockets()) {
      waited.push_back({socket.get(), POLLIN, 0});
      servers.push_back(entrance.server.get());
    }
  }
  while (true) {
    poll(waited.data(), waited.size(), -1);
    if (waited[0].revents != 0) return;
    bool short_of = false;
    for (std::size_t i = 1; i < waited.size() && !short_of; ++i) {
      if (waited[i].revents != 0) short_of = !accept_all(waited[i].fd, *servers[i]);
    }
    // The connection that was closed for it needs a moment to release its descriptors.
    if (short_of) std::this_thread::sleep_for(kPeriod);
  }
}

void Acceptor::watch() {
  while (true) {
    if (connections_.usage().open == 0) {
      pollfd waited = {look_.get(), POLLIN, 0};
      poll(&waited, 1, -1);
    } else {
      std::this_thread::sleep_for(kPeriod);
    }
    if (accepted_all_) return;
    eventfd_t count = 0;
    eventfd_read(look_.get(), &count);
    connections_.watch(Clock::now());
  }
}

// False if the process has no descriptor left.
bool Acceptor::accept_all(int listener, grpc::experimental::ExternalConnectionAcceptor& server) {
  for (int i = 0; i < kMostAtOnce; ++i) {
    Descriptor socket(accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!socket) return !is_shortage(errno) || out_of_descriptors(listener);
    const std::string peer = peer_of(socket.get());
    if (peer.empty()) continue;  // closed already
    Descriptor copy(fcntl(socket.get(), F_DUPFD_CLOEXEC, 0));
    if (!copy) {
      connections_.turned_away(peer);
      return !connections_.make_room();
    }
    // gRPC gets the copy: ThreadSanitizer sees accept4() here, but not that gRPC closes the descriptor, and
    // would report the next use of the number as a race.
    if (!connections_.add(std::move(socket), peer, Clock::now())) continue;
    eventfd_write(look_.get(), 1);
    grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters parameters;
    parameters.listener_fd = -1;
    parameters.fd = copy.release();
    server.HandleNewConnection(&parameters);
  }
  return true;
}

// Closes another connection, or else the one that waits: it would be accepted, and refused, forever.
bool Acceptor::out_of_descriptors(int listener) {
  if (connections_.make_room()) return false;
  reserve_.reset();
  {
    const Descriptor refused(accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (refused) connections_.turned_away(peer_of(refused.get()));
  }
  reserve_ = spare();
  return false;
}

}  // namespace marble::server
