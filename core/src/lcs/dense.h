// Views of the dense, row-major parts of systems and tasks.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>

#include "lcs/small_lcp.h"
#include "marble/lcs.h"
#include "model/linear_algebra.h"

namespace marble {

using ConstVectorMap = Eigen::Map<const Vector>;
using VectorMap = Eigen::Map<Vector>;

/// Returns the number of entries of an a × b matrix.
[[nodiscard]] inline std::size_t product(Index a, Index b) {
  return static_cast<std::size_t>(a) * static_cast<std::size_t>(b);
}
/// Views `size` numbers of stage `stage`.
[[nodiscard]] inline ConstVectorMap stage_of(std::span<const double> values, Index stage, Index size) {
  return {values.data() + static_cast<std::ptrdiff_t>(stage) * size, size};
}
/// As above, to write.
[[nodiscard]] inline VectorMap stage_of(std::span<double> values, Index stage, Index size) {
  return {values.data() + static_cast<std::ptrdiff_t>(stage) * size, size};
}
/// Views numbers that are one vector or matrix for all stages, or one per stage: those of stage `stage`.
[[nodiscard]] inline std::span<const double> part_of(std::span<const double> values, std::size_t entries,
                                                     Index stage) {
  return values.size() <= entries ? values
                                  : values.subspan(static_cast<std::size_t>(stage) * entries, entries);
}
/// Views a matrix.
[[nodiscard]] inline SmallLcp::ConstMap matrix_of(std::span<const double> values, Index rows, Index columns) {
  return {values.data(), rows, columns};
}

/// One stage of a system.
struct LcsStage {
  LcsStage(const LCS& lcs, Index stage)
      : A(matrix_of(lcs.part(LcsPart::A, stage), lcs.states(), lcs.states())),
        B(matrix_of(lcs.part(LcsPart::B, stage), lcs.states(), lcs.inputs())),
        D(matrix_of(lcs.part(LcsPart::D, stage), lcs.states(), lcs.pairs())),
        d(lcs.part(LcsPart::d, stage).data(), lcs.states()),
        E(matrix_of(lcs.part(LcsPart::E, stage), lcs.pairs(), lcs.states())),
        F(matrix_of(lcs.part(LcsPart::F, stage), lcs.pairs(), lcs.pairs())),
        H(matrix_of(lcs.part(LcsPart::H, stage), lcs.pairs(), lcs.inputs())),
        c(lcs.part(LcsPart::c, stage).data(), lcs.pairs()) {}

  SmallLcp::ConstMap A, B, D;
  ConstVectorMap d;
  SmallLcp::ConstMap E, F, H;
  ConstVectorMap c;
};

}  // namespace marble
