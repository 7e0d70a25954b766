#include "http/transport/pending_connections.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace marble::server::http {

PendingConnections::PendingConnections(std::size_t most, Host host)
    : most_(most),
      host_(std::move(host)),
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

void PendingConnections::enter(Guest guest) {
  {
    const MutexLock lock(mutex_);
    if (closed_) return;
    newcomers_.push_back(std::move(guest));
  }
  wake();
}

void PendingConnections::wake() const {
  const std::uint64_t once = 1;
  static_cast<void>(!::write(bell_, &once, sizeof once));  // a full counter wakes as well
}

void PendingConnections::run() {
  std::vector<Guest> guests;  // in order of arrival
  while (take_newcomers(guests)) {
    guests.erase(
        std::remove_if(guests.begin(), guests.end(), [this](const Guest& guest) { return !look_at(guest); }),
        guests.end());
    if (guests.size() > most_)
      guests.erase(guests.begin(), guests.end() - static_cast<std::ptrdiff_t>(most_));
    wait(guests);
  }
}

bool PendingConnections::take_newcomers(std::vector<Guest>& guests) {
  const MutexLock lock(mutex_);
  for (Guest& guest : newcomers_) guests.push_back(std::move(guest));
  newcomers_.clear();
  return !closed_;
}

bool PendingConnections::look_at(const Guest& guest) const {
  const Connection::Arrival arrival = guest->receive();
  if (arrival == Connection::Arrival::closed) return false;
  const bool late = Clock::now() >= guest->due();
  if (arrival == Connection::Arrival::head || (late && arrival == Connection::Arrival::line)) {
    host_(guest);
    return false;
  }
  return !late;
}

void PendingConnections::wait(const std::vector<Guest>& guests) const {
  std::vector<pollfd> entries = {{bell_, POLLIN, 0}};
  Clock::time_point next = Clock::time_point::max();
  for (const Guest& guest : guests) {
    entries.push_back(guest->awaited());
    next = std::min(next, guest->due());
  }
  int patience = -1;
  if (!guests.empty()) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(next - Clock::now()).count();
    patience = static_cast<int>(std::max<std::int64_t>(0, left));
  }
  poll(entries.data(), entries.size(), patience);
  std::uint64_t count = 0;
  static_cast<void>(!::read(bell_, &count, sizeof count));
}

}  // namespace marble::server::http
