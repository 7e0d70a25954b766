// Requests to send: the public example, a long solve, and small variations.
#pragma once

#include "marble/v1/service.pb.h"

namespace marble::testing {

/// min z'z  s.t.  z1 = 1, z2 >= 1, 0 <= z3 + 1 _|_ z4 - 1 >= 0. The optimum is 3, at (1, 1, 0, 1).
[[nodiscard]] v1::SolveRequest example_request();

/// A chain of coupled pairs at kappa = 1, followed in tiny steps of rho, a millisecond or more each. Each is
/// one full Newton step along a smooth path, whatever the machine: no test sees it end unless it limits the
/// iterations.
[[nodiscard]] v1::SolveRequest long_request(int max_iterations = 1'000'000);

}  // namespace marble::testing
