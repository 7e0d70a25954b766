// When to stop: a stop token, a moment, or never; and when to step aside. Everything that may take long looks
// at one about once a millisecond of its work.
#pragma once

#include <chrono>
#include <cstdint>
#include <stop_token>

#include "marble/progress.h"
#include "tuning.h"

namespace marble {

class Interrupt {
 public:
  using Clock = std::chrono::steady_clock;

  /// Never.
  Interrupt() = default;
  /// The moment is one of now().
  explicit Interrupt(std::stop_token stop, Clock::time_point moment = Clock::time_point::max(),
                     Pause* pause = nullptr)
      : stop_(std::move(stop)), moment_(moment), pause_(pause) {}

  /// Once it is true it stays so. Steps aside before, if it should.
  [[nodiscard]] bool requested() const {
    if (stop_requested()) return true;
    if (pause_ != nullptr) pause_->look();
    return now() >= moment_;
  }
  /// A clock that stands still while the solve is paused.
  [[nodiscard]] Clock::time_point now() const { return now(pause_); }
  [[nodiscard]] static Clock::time_point now(const Pause* pause) {
    return pause == nullptr ? Clock::now() : Clock::now() - pause->paused();
  }
  /// Whether it was the token.
  [[nodiscard]] bool stop_requested() const { return stop_.stop_requested(); }

 private:
  std::stop_token stop_;
  Clock::time_point moment_ = Clock::time_point::max();
  Pause* pause_ = nullptr;
};

/// `seconds` after `begin`; never, if that is too far away to tell.
[[nodiscard]] inline Interrupt::Clock::time_point after(Interrupt::Clock::time_point begin, double seconds) {
  constexpr auto kNever = Interrupt::Clock::time_point::max();
  const std::chrono::duration<double> left = kNever - begin;
  if (!(seconds < 0.5 * left.count())) return kNever;
  return begin +
         std::chrono::duration_cast<Interrupt::Clock::duration>(std::chrono::duration<double>(seconds));
}

/// Counts the work of some loops and looks at an Interrupt now and then.
class Checkpoint {
 public:
  explicit Checkpoint(const Interrupt& interrupt) : interrupt_(interrupt) {}

  /// Whether to stop, after so many entries more. Once it is true it stays so.
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
