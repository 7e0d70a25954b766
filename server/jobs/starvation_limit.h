// Chooses the next priority: the highest with something to do, except that one that was passed over too
// often or for too long in a row goes once in between.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>

#include "base/priority.h"

namespace marble::server {

class StarvationLimit {
 public:
  using Time = std::chrono::steady_clock::time_point;

  StarvationLimit(int most_turns, std::chrono::steady_clock::duration longest)
      : most_turns_(most_turns), longest_(longest) {}

  /// Chooses one of those that are able to go, or kPriorities if none is; counts the ones passed over.
  [[nodiscard]] std::size_t choose(const std::array<bool, kPriorities>& able, Time now) {
    std::size_t chosen = kPriorities;
    for (std::size_t at = kPriorities; at-- > 0;) {
      if (able[at]) chosen = at;
    }
    if (chosen == kPriorities) return chosen;
    int most = 0;
    for (std::size_t at = 0; at < kPriorities; ++at) {
      const Past& past = past_[at];
      const bool starved = past.turns >= most_turns_ || (past.turns > 0 && now - past.since >= longest_);
      if (!able[at] || !starved || past.turns <= most) continue;
      most = past.turns;
      chosen = at;
    }
    for (std::size_t at = 0; at < kPriorities; ++at) {
      Past& past = past_[at];
      if (!able[at] || at == chosen) {
        past.turns = 0;
      } else if (past.turns++ == 0) {
        past.since = now;
      }
    }
    return chosen;
  }

 private:
  struct Past {
    int turns = 0;  // number of times in a row
    Time since;
  };
  const int most_turns_;
  const std::chrono::steady_clock::duration longest_;
  std::array<Past, kPriorities> past_ = {};
};

}  // namespace marble::server
