// Problems that the clients send, and what they make of the answers.
#pragma once

#include <string>
#include <vector>

#include "marble/v1/service.pb.h"

namespace marble::testing {

/// Problems that take from a fraction of a millisecond to some ten milliseconds each.
[[nodiscard]] const std::vector<v1::SolveRequest>& small_problems();

struct Judgement {
  bool solved = false;
  std::string fault;  ///< what is wrong with the answer; empty if nothing
};

/// Checks an answer by plain loops over the problem that was sent.
[[nodiscard]] Judgement judge(const v1::Problem& problem, const v1::Solution& solution);

}  // namespace marble::testing
