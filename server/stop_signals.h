// SIGTERM and SIGINT as events to wait for.
#pragma once

namespace marble::server {

/// One object per process. Handlers, not blocked signals: threads that libraries started before main() block
/// nothing, and the default action in one of them would end the process.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// Waits for the next signal, or for wake(). The signal's number, 0 for wake().
  int wait();
  /// Ends one wait() from any thread.
  void wake();

 private:
  int read_end_ = -1;
};

}  // namespace marble::server
