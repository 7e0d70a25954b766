#include "process/signals.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <csignal>
#include <stdexcept>
#include <thread>

namespace marble::server {
namespace {

// A signal handler can access only global state.
int write_end = -1;

void pass_on(int signal) {
  const int saved = errno;
  const auto byte = static_cast<unsigned char>(signal);
  [[maybe_unused]] const auto written = write(write_end, &byte, 1);  // a full pipe contains enough signals
  errno = saved;
}

void handle(int signal, void (*handler)(int)) {
  struct sigaction action = {};
  action.sa_handler = handler;
  sigaction(signal, &action, nullptr);
}

}  // namespace

Signals::Signals() {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe for signals");
  read_end_ = ends[0];
  write_end = ends[1];
  fcntl(write_end, F_SETFL, O_NONBLOCK);
  handle(SIGTERM, pass_on);
  handle(SIGINT, pass_on);
  handle(SIGHUP, pass_on);
  handle(SIGPIPE, SIG_IGN);
  handle(SIGXFSZ, SIG_IGN);  // exceeding a file size limit is an error of the write
}

Signals::~Signals() {
  handle(SIGTERM, SIG_IGN);  // further signals during the exit are ignored
  handle(SIGINT, SIG_IGN);
  handle(SIGHUP, SIG_IGN);
  close(read_end_);
  close(write_end);
}

int Signals::wait() {
  unsigned char byte = 0;
  while (read(read_end_, &byte, 1) < 0 && errno == EINTR) {
  }
  return byte;
}

int Signals::wait_for(std::chrono::duration<double> limit) {
  const auto end = std::chrono::steady_clock::now() + limit;
  pollfd readable{read_end_, POLLIN, 0};
  for (auto left = limit; left.count() > 0.0; left = end - std::chrono::steady_clock::now()) {
    if (poll(&readable, 1, static_cast<int>(std::ceil(left.count() * 1e3))) > 0) return wait();
  }
  return 0;
}

// Detached: a read of standard input cannot be cancelled, and ends with the process.
void Signals::watch_standard_input() {
  std::thread([] {
    char ignored[256];
    while (true) {
      const ssize_t got = read(STDIN_FILENO, ignored, sizeof ignored);
      if (got == 0 || (got < 0 && errno != EINTR)) break;
    }
    kill(getpid(), SIGTERM);
  }).detach();
}

void Signals::wake() { pass_on(0); }

}  // namespace marble::server
