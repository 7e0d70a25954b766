// Handles Ctrl-C while the solver runs on Python's main thread.
#pragma once

#include <csignal>
#include <stop_token>

namespace marble::python {

/// During its lifetime SIGINT also requests a stop; Python's own handler then decides the consequence. Python
/// itself would process the signal only after the solve. For the main thread; nested ones stop together.
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
