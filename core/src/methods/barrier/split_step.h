// The equality constrained QPs of ALADIN-β, its local Newton steps and its coordination alike: in steps of z
// and of q and m, the two sides of what the products s∘t may miss zero by,
//   min ½ dzᵀQdz + (Qz + g + Aᵀy)ᵀdz + Σ (½ h e² + f e) + Σ κ ds dt
//   over  A dz = −(Az + b)  and  t ds + s dt − dq + dm = −G,
// where e = [J dz; dq; dm], the changes of all rows [C; L; R], of which (ds, dt) are the pairs', and of q and
// m, each has its curvature h and slope f. dq and dm are not solved for: they make a weight of t ds + s dt.
#pragma once

#include "data/residual.h"
#include "kkt/kkt.h"
#include "run/run.h"

namespace marble {

class SplitStep {
 public:
  SplitStep(const ScaledProblem& problem, Kkt& kkt, const Options& options);
  /// How many numbers e has, for a problem with these rows.
  [[nodiscard]] static Index split_size(const RowLayout& rows) { return rows.size() + 2 * rows.pairs; }

  Vector curvature;  ///< h, of all of e; > 0 of dq and dm
  Vector slope;      ///< f, of all of e
  Vector coupling;   ///< κ, n_c
  Vector product;    ///< G, n_c

  /// From a point with y that has these images, its rows without multipliers. False if no δ makes it convex.
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
