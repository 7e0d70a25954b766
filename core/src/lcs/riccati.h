// The discrete algebraic Riccati equation P = Q + Aᵀ P A − Aᵀ P B (R + Bᵀ P B)⁻¹ Bᵀ P A.
#pragma once

#include <vector>

#include "lcs/small_lcp.h"
#include "marble/error.h"

namespace marble {

/// Returns its stabilizing solution, by the structure-preserving doubling algorithm (Chu, Fan, Lin and Wang,
/// "Structure-preserving algorithms for periodic discrete-time algebraic Riccati equations", 2004). Errors:
/// failed_precondition of field "P" if it does not converge, as where (A, B) is not stabilizable.
[[nodiscard]] Expected<std::vector<double>> riccati(const SmallLcp::ConstMap& A, const SmallLcp::ConstMap& B,
                                                    const SmallLcp::ConstMap& Q, const SmallLcp::ConstMap& R);

}  // namespace marble
