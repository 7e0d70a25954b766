// The numbers that were chosen for the methods of others, beside those of the solver.
#pragma once

#include "model/tuning.h"

namespace marble::tuning {

#include "research/tuning.def"

}  // namespace marble::tuning
