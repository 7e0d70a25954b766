// Whether an answer is one: by plain loops and small dense matrices over the user's own data, none of it the
// solver's code. A wrong answer is a finding (findings.h).
#pragma once

#include "marble/options.h"
#include "marble/problem.h"
#include "marble/v1/sensitivity.pb.h"
#include "marble/v1/service.pb.h"
#include "marble/v1/solution.pb.h"

namespace marble::fuzz {

/// An error that a client can act on.
void expect_sound(const Error& error);

/// It can be sent: its bytes are read back as the same, and its numbers are finite but where the contract
/// says otherwise, or the point is so large that they overflow.
void expect_sound(const v1::Solution& answer);

/// Sizes, and what is claimed of z and the multipliers: feasible, complementary, stationary on its branch,
/// the reported violations and objective, certificates; of small problems also the global optimum,
/// by enumeration. Of hostile data only the first digit of the stationarity is judged: more is a matter of
/// scale. Equality rows hold to the options' tolerance, and to `agreement` relative to the largest term,
/// which stationarity may also be off by.
void judge_answer(const ProblemView& problem, const Options& options, const v1::Solution& answer,
                  double agreement = 0.0);

/// Derivatives, by the branch's own system.
void judge_derivatives(const ProblemView& problem, const v1::SensitivityRequest& request,
                       const v1::Solution& answer);

/// An answer to any request that was admitted.
void judge_request(const v1::SolveRequest& request, const Options& options, const v1::Solution& answer);

/// Whether its numbers are of the size of 1, so that tolerances mean what they say.
[[nodiscard]] bool is_friendly(const ProblemView& problem);

}  // namespace marble::fuzz
