// Signals that concern a full screen, as something to wait for.
#pragma once

namespace marble::cli {

/// While it lives, SIGINT, SIGTERM, SIGHUP, SIGTSTP and SIGCONT do nothing of their own but are read here, in
/// their order. One at a time.
class TerminalSignals {
 public:
  TerminalSignals();
  ~TerminalSignals();
  TerminalSignals(const TerminalSignals&) = delete;
  TerminalSignals& operator=(const TerminalSignals&) = delete;

  /// Readable when one has come.
  [[nodiscard]] int descriptor() const;
  /// The next one, or 0.
  [[nodiscard]] int take();
  /// Stops this process, as SIGTSTP would have; returns when it goes on.
  void stop_here();
};

}  // namespace marble::cli
