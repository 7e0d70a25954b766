// Solves the equality-constrained QPs of ALADIN-β, those of its local Newton steps and of its coordination,
// in steps of z and of q and m, the positive and negative parts by which the products s∘t miss zero:
//   min ½ dzᵀQdz + (Qz + g + Aᵀy)ᵀdz + Σ (½ h e² + f e) + Σ κ ds dt
//   over  A dz = −(Az + b)  and  t ds + s dt − dq + dm = −G,
// where e = [J dz; dq; dm] contains the changes of all rows [C; L; R], including (ds, dt) of the pairs, and
// those of q and m. Each has a curvature h and a slope f. dq and dm are eliminated into a weight of
// t ds + s dt.
#pragma once

#include "kkt/kkt.h"
#include "model/residual.h"
#include "path/run.h"

namespace marble {

class SplitStep {
 public:
  SplitStep(const ScaledProblem& problem, Kkt& kkt, const Options& options);
  /// Returns the size of e for a problem with these rows.
  [[nodiscard]] static Index split_size(const RowLayout& rows) { return rows.size() + 2 * rows.pairs; }

  Vector curvature;  ///< h, for all of e; > 0 for dq and dm
  Vector slope;      ///< f, for all of e
  Vector coupling;   ///< κ, n_c
  Vector product;    ///< G, n_c

  /// Solves from a point with y that has these images, without multipliers of its rows. Returns false if no δ
  /// makes the QP convex.
  [[nodiscard]] bool solve(Run& run, const Images& at);

  Vector z_step;      ///< n
  Vector y_step;      ///< n_e
  Vector step;        ///< e
  Vector multiplier;  ///< of the last row, n_c

 private:
  void weigh(const Images& at);

  const ScaledProblem& problem_;
  Kkt& kkt_;
  const Options& options_;
  RowWeights weights_;
  RowVector rhs_;
  Vector weight_;  // of t ds + s dt
  double delta_ = 0.0;
};

}  // namespace marble
