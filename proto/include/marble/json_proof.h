// Proofs as files, a line of JSON a leaf: the format is in client/FORMATS.md. Knows nothing of protobuf and
// gRPC.
#pragma once

#include <functional>
#include <string_view>

#include "marble/options.h"
#include "marble/problem.h"
#include "marble/report/proof.h"
#include "marble/solution.h"

namespace marble {

/// Hands a proof to `write`, line by line, whose claim is not Proof::Claim::none. With the answer it is of,
/// if that is solved, and what the options call feasible. Doubles keep every bit.
void write_proof(const Proof& proof, const ProblemView& problem, const Options& options,
                 const Solution& solution, const std::function<void(std::string_view)>& write);

}  // namespace marble
