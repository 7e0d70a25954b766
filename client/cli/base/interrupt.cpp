#include "base/interrupt.h"

#include <semaphore.h>

#include <atomic>
#include <cerrno>
#include <csignal>

namespace marble::cli {
namespace {

// The only objects that a signal handler can reach and may use. (Blocking the signal and waiting for it in
// one thread is not enough: libraries start threads before main, and any of them may receive the signal.)
sem_t woken;
std::atomic<bool> interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free);

void on_interrupt(int) {
  const int saved = errno;
  interrupted = true;
  sem_post(&woken);
  errno = saved;
}

bool is_ignored() {
  struct sigaction current = {};
  return sigaction(SIGINT, nullptr, &current) == 0 && current.sa_handler == SIG_IGN;
}

}  // namespace

Interrupt::Interrupt() {
  if (is_ignored()) return;
  sem_init(&woken, 0, 0);
  watch_ = std::thread([this] {
    while (sem_wait(&woken) != 0) {
    }
    if (interrupted) source_.request_stop();
  });
  struct sigaction action = {};
  action.sa_handler = on_interrupt;
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
}

Interrupt::~Interrupt() {
  if (!watch_.joinable()) return;
  std::signal(SIGINT, SIG_DFL);
  sem_post(&woken);
  watch_.join();
  sem_destroy(&woken);
}

}  // namespace marble::cli
