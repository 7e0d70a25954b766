// Describes the load of a run: which loop, how often, for how long.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "arrivals.h"
#include "scenario.h"

namespace marble::load {

enum class Loop {
  closed,  ///< each client sends the next request as soon as it has its result
  open,    ///< requests are sent at their times, whatever the server does
};

struct Plan {
  Loop loop = Loop::closed;
  Mode mode = Mode::unary;
  int clients = 1;          ///< closed: that send; open: that requests are distributed over
  int connections = 1;      ///< clients share them
  double rate_per_s = 0.0;  ///< open
  ArrivalProcess arrivals = ArrivalProcess::poisson;
  double warm_up_s = 2.0, duration_s = 10.0;
  std::uint64_t count = 0;           ///< if > 0: this many measured requests instead of a duration
  std::uint64_t in_flight = 10'000;  ///< open: most requests in progress at once
  double patience_s = 30.0;          ///< for results after the last request
  double check = 0.1;                ///< part of the solutions that is checked, in [0, 1]
  std::uint64_t seed = 1;
};

}  // namespace marble::load
