// How long a client waits for a server that is lost.
#pragma once

#include <chrono>
#include <optional>

namespace marble::client {

/// Of one loss after the other: pauses of 0.1 s, then twice as long each time up to 1 s, by up to a fifth
/// shorter.
class Patience {
 public:
  using Seconds = std::chrono::duration<double>;

  /// `wait` counts from a loss on. Without it, it is 10 s where a server was ever `reached`, else less than a
  /// second: a wrong address is told at once.
  Patience(std::optional<Seconds> wait, bool reached) : wait_(wait), reached_(reached) {}

  /// A server has answered: what is lost from here on is another loss.
  void reached();
  /// How long to wait before the next try; nothing once there shall be none.
  [[nodiscard]] std::optional<Seconds> pause();

 private:
  std::optional<Seconds> wait_;
  bool reached_;
  Seconds next_{0.0};
  std::optional<std::chrono::steady_clock::time_point> since_;
};

}  // namespace marble::client
