#include "process/supervisor.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace marble::server {
namespace {

constexpr const char* kVariable = "NOTIFY_SOCKET";

long long monotonic_us() {
  timespec now = {};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1'000'000LL + now.tv_nsec / 1000;
}

}  // namespace

Supervisor::Supervisor() {
  if (const char* socket = std::getenv(kVariable); socket != nullptr) socket_ = socket;
  unsetenv(kVariable);
}

void Supervisor::ready() const { report("READY=1"); }

void Supervisor::reloading() const {
  report("RELOADING=1\nMONOTONIC_USEC=" + std::to_string(monotonic_us()));
}

void Supervisor::stopping() const { report("STOPPING=1"); }

void Supervisor::report(std::string_view state) const {
  sockaddr_un name = {};
  name.sun_family = AF_UNIX;
  if (socket_.size() < 2 || socket_.size() >= sizeof name.sun_path) return;
  std::memcpy(name.sun_path, socket_.data(), socket_.size());
  // A leading @ stands for the zero byte of an abstract name, whose end is given by its length.
  if (name.sun_path[0] == '@') name.sun_path[0] = '\0';
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + socket_.size());
  const int sender = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (sender < 0) return;
  [[maybe_unused]] const auto sent = sendto(sender, state.data(), state.size(), MSG_NOSIGNAL,
                                            reinterpret_cast<const sockaddr*>(&name), length);
  close(sender);
}

}  // namespace marble::server
