// Provides the last resorts of a solve without a solution: proofs that none exists, and otherwise a feasible
// point. They use their own workspace, within Run::bytes_left; if that is too little, they find nothing.
#pragma once

#include <optional>
#include <vector>

#include "branch/branch_point.h"
#include "path/certificate.h"
#include "path/proof_record.h"
#include "path/run.h"

namespace marble {

/// Searches for a contradiction of the constraints without complementarity, from z (scaled). The elastic
/// optimum of this relaxation has the least violation, which gives the multipliers of the proof.
[[nodiscard]] std::optional<FarkasProof> prove_infeasible(const ScaledProblem& p, ConstVectorRef z, Run& run);

/// The same for a relaxation of p that begins with the rows [C; L; R], in which some sides of pairs are fixed
/// at zero. Uses the elastic optimum of tuning::middle_rho at `point`, whose factor `kkt` holds.
[[nodiscard]] std::optional<FarkasProof> prove_contradiction(const ScaledProblem& p,
                                                             const ScaledProblem& relaxed, Kkt& kkt,
                                                             const BranchPoint& point);

/// Returns the point nearest to `target` in the branch that z is nearest to, if it is within the tolerances.
/// Scaled.
[[nodiscard]] std::optional<Vector> feasible_point(const ScaledProblem& p, const Options& options,
                                                   ConstVectorRef z, ConstVectorRef target, Run& run);

/// A feasible point and a direction along which the objective decreases from it without bound.
struct UnboundedRay {
  Vector origin;                  ///< scaled
  std::vector<double> direction;  ///< user units, largest entry 1
};

/// Searches for a ray in the branch that z is nearest to. Either z (scaled) diverges, or it would along
/// `direction`.
[[nodiscard]] std::optional<UnboundedRay> prove_unbounded(const ScaledProblem& p, const Options& options,
                                                          ConstVectorRef z, ConstVectorRef direction,
                                                          Run& run);

/// Searches for a ray in this branch along which Q is flat, as the reason why the branch has no solution.
[[nodiscard]] std::optional<UnboundedRay> prove_branch_unbounded(const ScaledProblem& p,
                                                                 const Options& options,
                                                                 const WorkingSet& branch, Run& run);

/// Returns multipliers that contradict the rows of this branch, or nothing if no proof is found.
[[nodiscard]] std::optional<LeafMultipliers> branch_contradiction(const ScaledProblem& p,
                                                                  const WorkingSet& branch, Run& run);

}  // namespace marble
