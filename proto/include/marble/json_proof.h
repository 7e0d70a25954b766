// Proofs as files, one line of JSON per leaf: the format is in client/FORMATS.md. Independent of protobuf
// and gRPC.
#pragma once

#include <functional>
#include <string_view>

#include "marble/options.h"
#include "marble/problem.h"
#include "marble/report/proof.h"
#include "marble/solution.h"

namespace marble {

/// Passes a proof whose claim is not Proof::Claim::none to `write`, line by line, with its solution, if that
/// is solved, and the feasibility tolerances of the options. Doubles keep every bit.
void write_proof(const Proof& proof, const ProblemView& problem, const Options& options,
                 const Solution& solution, const std::function<void(std::string_view)>& write);

}  // namespace marble
