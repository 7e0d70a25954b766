// Plans as a robot does: a receding horizon in a session, at a fixed rate.
#pragma once

#include "bench.h"
#include "marble/examples.h"

namespace marble::bench {

/// A hopper, whose plan moves on by one stage at each step.
class ControlLoop {
 public:
  /// Solves the first plan. `client` is the name of the session's client.
  ControlLoop(const std::string& address, int stages, v1::Priority priority, const std::string& client);

  struct Steps {
    std::vector<double> latency_ms;
    int wrong = 0;
  };
  /// Takes one step each kPeriod, or as soon as the last one is answered if that is later.
  [[nodiscard]] Steps run(int count);
  static constexpr std::chrono::milliseconds kPeriod{20};

 private:
  examples::HopperParameters parameters_;
  Session session_;
  Solution plan_;
};

}  // namespace marble::bench
