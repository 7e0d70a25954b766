#include "terminal/signals.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>

namespace marble::cli {
namespace {

constexpr std::array kSignals = {SIGINT, SIGTERM, SIGHUP, SIGTSTP, SIGCONT};

// The only objects that a signal handler can reach and may use.
std::array<int, 2> ends = {-1, -1};
std::array<struct sigaction, kSignals.size()> before;

void on_signal(int signal) {
  const int saved = errno;
  const auto byte = static_cast<unsigned char>(signal);
  [[maybe_unused]] const auto written = write(ends[1], &byte, 1);
  errno = saved;
}

void take_over(int signal, struct sigaction* old) {
  struct sigaction action = {};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  sigaction(signal, &action, old);
}

}  // namespace

TerminalSignals::TerminalSignals() {
  if (pipe2(ends.data(), O_NONBLOCK | O_CLOEXEC) != 0) return;
  for (std::size_t i = 0; i < kSignals.size(); ++i) take_over(kSignals[i], &before[i]);
}

TerminalSignals::~TerminalSignals() {
  if (ends[0] < 0) return;
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &before[i], nullptr);
  for (int& end : ends) {
    close(end);
    end = -1;
  }
}

int TerminalSignals::descriptor() const { return ends[0]; }

int TerminalSignals::take() {
  unsigned char byte = 0;
  return read(ends[0], &byte, 1) == 1 ? byte : 0;
}

void TerminalSignals::stop_here() {
  std::signal(SIGTSTP, SIG_DFL);
  kill(getpid(), SIGTSTP);
  take_over(SIGTSTP, nullptr);
}

}  // namespace marble::cli
