// Provides the time that a client waits for a lost server.
#pragma once

#include <chrono>
#include <optional>
#include <stop_token>

namespace marble::client {

/// Pauses after consecutive losses: 0.1 s, then twice as long each time up to 1 s, shortened at random by up
/// to a fifth.
class Patience {
 public:
  using Seconds = std::chrono::duration<double>;

  /// `wait` counts from a loss on. Default: 10 s if a server was ever `reached`, else less than a second, so
  /// that a wrong address is reported soon.
  Patience(std::optional<Seconds> wait, bool reached) : wait_(wait), reached_(reached) {}

  /// Notes that a server has responded: the next loss counts anew.
  void reached();
  /// Returns how long to wait before the next try; nothing if there is none.
  [[nodiscard]] std::optional<Seconds> pause();

 private:
  std::optional<Seconds> wait_;
  bool reached_;
  Seconds next_{0.0};
  std::optional<std::chrono::steady_clock::time_point> since_;
};

/// Returns a random factor in [low, high) for a pause: clients that lose a server together do not return
/// together.
[[nodiscard]] double random_factor(double low, double high);

/// Waits. Returns true as soon as a stop is requested.
[[nodiscard]] bool is_stopped_within(Patience::Seconds pause, const std::stop_token& stop);

}  // namespace marble::client
