// Chooses units in which the numbers of a problem are near 1.
#pragma once

#include "model/scaling.h"

namespace marble {

/// Returns the units, powers of two, by which a problem is scaled first, so that the following steps do not
/// depend on the user's. They minimize the sum of squares of log |E a D| over the entries of [A; C; L; R], of
/// log |E b| over their constants, of log |c D q D| over the entries of Q, and of log |c D g|. The same
/// problem in other units thus gives the same numbers. (Curtis and Reid, "On the automatic scaling of
/// matrices for Gaussian elimination", 1972, extended by constants and cost.) The units are rounded to powers
/// of two and limited by tuning::scale_range. A unit within 2^±tuning::units_bits of 1 stays 1, and all units
/// stay 1 if all numbers are within that range. A number that may be a rounding error counts as a zero: one
/// below tuning::roundoff of the largest of its kind, and a constant below tuning::constant_noise of its
/// row's largest entry, in the user's units and in the fitted ones. `p` must contain the user's numbers.
[[nodiscard]] ScaleFactors choose_units(const ScaledProblem& p, const Interrupt& interrupt);

}  // namespace marble
