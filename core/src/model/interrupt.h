// Provides the condition that ends a solve (a stop token, a time, or never) and the requests to pause it.
// Long operations check it about once per millisecond of work.
#pragma once

#include <chrono>
#include <cstdint>
#include <stop_token>

#include "marble/progress.h"
#include "model/tuning.h"

namespace marble {

class Interrupt {
 public:
  using Clock = std::chrono::steady_clock;

  /// Never interrupts.
  Interrupt() = default;
  /// `moment` is a time of now().
  explicit Interrupt(std::stop_token stop, Clock::time_point moment = Clock::time_point::max(),
                     Pause* pause = nullptr)
      : stop_(std::move(stop)), moment_(moment), pause_(pause) {}

  /// True if the solve must stop; once true, it stays true. If a pause is requested, it pauses first.
  [[nodiscard]] bool requested() const {
    if (stop_requested()) return true;
    if (pause_ != nullptr) pause_->look();
    return now() >= moment_;
  }
  /// Returns the time of a clock that stands still while the solve is paused.
  [[nodiscard]] Clock::time_point now() const { return now(pause_); }
  [[nodiscard]] static Clock::time_point now(const Pause* pause) {
    return pause == nullptr ? Clock::now() : Clock::now() - pause->paused();
  }
  /// True if the stop token requested the stop.
  [[nodiscard]] bool stop_requested() const { return stop_.stop_requested(); }

 private:
  std::stop_token stop_;
  Clock::time_point moment_ = Clock::time_point::max();
  Pause* pause_ = nullptr;
};

/// Returns the time `seconds` after `begin`, or never if that is out of range.
[[nodiscard]] inline Interrupt::Clock::time_point after(Interrupt::Clock::time_point begin, double seconds) {
  constexpr auto kNever = Interrupt::Clock::time_point::max();
  const std::chrono::duration<double> left = kNever - begin;
  if (!(seconds < 0.5 * left.count())) return kNever;
  return begin +
         std::chrono::duration_cast<Interrupt::Clock::duration>(std::chrono::duration<double>(seconds));
}

/// Counts the work of loops and checks an Interrupt from time to time.
class Checkpoint {
 public:
  explicit Checkpoint(const Interrupt& interrupt) : interrupt_(interrupt) {}

  /// Counts this many more entries and returns true if the loop must stop; once true, it stays true.
  [[nodiscard]] bool reached(std::int64_t entries) {
    left_ -= entries;
    return left_ < 0 && look();
  }

 private:
  [[nodiscard]] bool look() {
    if (interrupt_.requested()) return true;
    left_ = tuning::entries_between_looks;
    return false;
  }

  const Interrupt& interrupt_;
  std::int64_t left_ = tuning::entries_between_looks;
};

}  // namespace marble
