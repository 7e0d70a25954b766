#include "ctrl_c.h"

#include <atomic>

namespace marble::python {
namespace {

// The newest living one, for the handler.
std::atomic<CtrlC*> newest = nullptr;
static_assert(std::atomic<CtrlC*>::is_always_lock_free);

}  // namespace

CtrlC::CtrlC(std::stop_source& source) : source_(source), below_(newest.load()) {
  sigaction(SIGINT, nullptr, &previous_);
  if ((previous_.sa_flags & SA_SIGINFO) != 0) return;  // not Python's handler
  installed_ = true;
  newest = this;
  struct sigaction action = previous_;
  action.sa_handler = on_signal;
  sigaction(SIGINT, &action, nullptr);
}

CtrlC::~CtrlC() {
  if (!installed_) return;
  struct sigaction current = {};
  sigaction(SIGINT, nullptr, &current);
  // Another handler set meanwhile is kept.
  if ((current.sa_flags & SA_SIGINFO) == 0 && current.sa_handler == on_signal)
    sigaction(SIGINT, &previous_, nullptr);
  newest = below_;
}

// These sources have no callbacks, so a request is only a store into an atomic.
void CtrlC::on_signal(int signal) {
  CtrlC* oldest = nullptr;
  for (CtrlC* one = newest; one != nullptr; one = one->below_) {
    one->source_.request_stop();
    oldest = one;
  }
  if (oldest != nullptr) oldest->previous_.sa_handler(signal);
}

}  // namespace marble::python
