// Provides the signals that concern a full screen as a descriptor to wait for.
#pragma once

namespace marble::cli {

/// During its lifetime SIGINT, SIGTERM, SIGHUP, SIGTSTP and SIGCONT have no effect of their own and are read
/// here, in their order. Only one may exist at a time.
class TerminalSignals {
 public:
  TerminalSignals();
  ~TerminalSignals();
  TerminalSignals(const TerminalSignals&) = delete;
  TerminalSignals& operator=(const TerminalSignals&) = delete;

  /// Readable when a signal has arrived.
  [[nodiscard]] int descriptor() const;
  /// Returns the next signal, or 0.
  [[nodiscard]] int take();
  /// Stops this process, as SIGTSTP would have; returns when it continues.
  void stop_here();
};

}  // namespace marble::cli
