// Units in which the numbers of a problem are near 1.
#pragma once

#include "data/scaling.h"

namespace marble {

/// Powers of two to scale a problem with first, so that what follows need not depend on the user's units.
struct Units {
  Vector variable;  ///< D, n
  Vector equality;  ///< E of A, n_e
  Vector row;       ///< E of [C; L; R]
  double cost = 1.0;
};

/// Those that minimise the squares of log |E a D| over the entries of [A; C; L; R], of log |E b| over their
/// constants, of log |c D q D| over those of Q, and of log |c D g|: so in other units the same numbers come
/// out. (Curtis and Reid, "On the automatic scaling of matrices for Gaussian elimination", 1972, with
/// constants and cost.) Rounded to powers of two, none beyond tuning::scale_range; what is within
/// 2^±tuning::units_bits of 1 stays 1, and all of them where all numbers are. Of p, whose numbers are the
/// user's.
[[nodiscard]] Units choose_units(const ScaledProblem& p, const Interrupt& interrupt);

}  // namespace marble
