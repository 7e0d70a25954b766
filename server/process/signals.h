// SIGTERM and SIGINT (stop) and SIGHUP (reload) as events to wait for.
#pragma once

#include <chrono>

namespace marble::server {

/// One object per process. Uses handlers, not blocked signals: threads that libraries started before main()
/// block nothing, and the default action in one of them would end the process.
class Signals {
 public:
  Signals();
  ~Signals();
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;

  /// Waits for the next signal, or for wake(). Returns the signal's number, 0 for wake().
  int wait();
  /// The same for at most `limit`; also returns 0 if no signal came.
  int wait_for(std::chrono::duration<double> limit);
  /// From now on the end of standard input counts as a SIGTERM.
  void watch_standard_input();
  /// Ends one wait() from any thread.
  void wake();

 private:
  int read_end_ = -1;
};

}  // namespace marble::server
