// Ctrl-C while the solver runs on Python's main thread.
#pragma once

#include <csignal>
#include <stop_token>

namespace marble::python {

/// While it lives SIGINT also requests a stop, after which Python's own handler says what becomes of it.
/// Python itself would look at the signal only once the solve has ended. For the main thread; nested ones
/// stop together.
class CtrlC {
 public:
  explicit CtrlC(std::stop_source& source);
  CtrlC(const CtrlC&) = delete;
  CtrlC& operator=(const CtrlC&) = delete;
  ~CtrlC();

 private:
  static void on_signal(int signal);

  std::stop_source& source_;
  CtrlC* below_;
  struct sigaction previous_ = {};
  bool installed_ = false;
};

}  // namespace marble::python
