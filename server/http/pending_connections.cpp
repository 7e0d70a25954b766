#include "http/pending_connections.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace marble::server::http {

PendingConnections::PendingConnections(std::size_t most, Handler handler)
    : most_(most),
      handler_(std::move(handler)),
      bell_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
      thread_([this] { run(); }) {}

PendingConnections::~PendingConnections() {
  close();
  ::close(bell_);
}

void PendingConnections::close() {
  {
    const MutexLock lock(mutex_);
    closed_ = true;
  }
  wake();
  if (thread_.joinable()) thread_.join();
}

void PendingConnections::enter(Pending connection) {
  {
    const MutexLock lock(mutex_);
    if (closed_) return;
    newcomers_.push_back(std::move(connection));
  }
  wake();
}

void PendingConnections::wake() const {
  const std::uint64_t once = 1;
  static_cast<void>(!::write(bell_, &once, sizeof once));  // a full counter wakes as well
}

void PendingConnections::run() {
  std::vector<Pending> connections;  // in order of arrival
  while (take_newcomers(connections)) {
    connections.erase(std::remove_if(connections.begin(), connections.end(),
                                     [this](const Pending& connection) { return !look_at(connection); }),
                      connections.end());
    if (connections.size() > most_)
      connections.erase(connections.begin(), connections.end() - static_cast<std::ptrdiff_t>(most_));
    wait(connections);
  }
}

bool PendingConnections::take_newcomers(std::vector<Pending>& connections) {
  const MutexLock lock(mutex_);
  for (Pending& connection : newcomers_) connections.push_back(std::move(connection));
  newcomers_.clear();
  return !closed_;
}

bool PendingConnections::look_at(const Pending& connection) const {
  const Connection::Arrival arrival = connection->receive();
  if (arrival == Connection::Arrival::closed) return false;
  const bool late = Clock::now() >= connection->due();
  if (arrival == Connection::Arrival::head || (late && arrival == Connection::Arrival::line)) {
    handler_(connection);
    return false;
  }
  return !late;
}

void PendingConnections::wait(const std::vector<Pending>& connections) const {
  std::vector<pollfd> entries = {{bell_, POLLIN, 0}};
  Clock::time_point next = Clock::time_point::max();
  for (const Pending& connection : connections) {
    entries.push_back(connection->awaited());
    next = std::min(next, connection->due());
  }
  int patience = -1;
  if (!connections.empty()) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(next - Clock::now()).count();
    patience = static_cast<int>(std::max<std::int64_t>(0, left));
  }
  poll(entries.data(), entries.size(), patience);
  std::uint64_t count = 0;
  static_cast<void>(!::read(bell_, &count, sizeof count));
}

}  // namespace marble::server::http
