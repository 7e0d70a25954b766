// The last resorts of a solve without an answer: proofs that there is none, and a feasible point if nothing
// else; with workspace of their own, within Run::bytes_left: where that does not do, nothing is found.
#pragma once

#include <optional>
#include <vector>

#include "branch/branch_point.h"
#include "run/certificate.h"
#include "run/proof_record.h"
#include "run/run.h"

namespace marble {

/// Looks for a contradiction of the constraints without complementarity, from z (scaled): the elastic optimum
/// of the relaxation has the least violation, and what is left of it are the multipliers.
[[nodiscard]] std::optional<FarkasProof> prove_infeasible(const ScaledProblem& p, ConstVectorRef z, Run& run);

/// The same of a relaxation of p, its rows [C; L; R] first, some of them sides of pairs that are fixed at
/// zero: what the elastic optimum of tuning::middle_rho at `point`, whose factor `kkt` holds, proves.
[[nodiscard]] std::optional<FarkasProof> prove_contradiction(const ScaledProblem& p,
                                                             const ScaledProblem& relaxed, Kkt& kkt,
                                                             const BranchPoint& point);

/// The nearest point to `target` in the branch that z is nearest to, if it is within the tolerances. Scaled.
[[nodiscard]] std::optional<Vector> feasible_point(const ScaledProblem& p, const Options& options,
                                                   ConstVectorRef z, ConstVectorRef target, Run& run);

/// A feasible point and a direction along which the objective falls from it without bound.
struct UnboundedRay {
  Vector origin;                  ///< scaled
  std::vector<double> direction;  ///< user units, largest entry 1
};

/// Looks for one in the branch that z is nearest to: z (scaled) runs off, or `direction` is one along which
/// it would.
[[nodiscard]] std::optional<UnboundedRay> prove_unbounded(const ScaledProblem& p, const Options& options,
                                                          ConstVectorRef z, ConstVectorRef direction,
                                                          Run& run);

/// Looks for one in this branch, along which Q is flat: whether that is why the branch has no solution.
[[nodiscard]] std::optional<UnboundedRay> prove_branch_unbounded(const ScaledProblem& p,
                                                                 const Options& options,
                                                                 const WorkingSet& branch, Run& run);

/// What contradicts the rows of this branch; nothing if no proof of that is found.
[[nodiscard]] std::optional<LeafMultipliers> branch_contradiction(const ScaledProblem& p,
                                                                  const WorkingSet& branch, Run& run);

}  // namespace marble
