// Nonlinear problems of Python functions, for the loop of marble::nonlinear.
#pragma once

#include <pybind11/pybind11.h>

#include "marble/nonlinear.h"

namespace marble::python {

/// problem: `values`, `derivatives` and `hessian` (or None) as marble.nlp wraps them, and the arrays `start`,
/// `lower`, `upper`, `scale` and `blocks`. Ticks run without the GIL. What a function raises goes through.
[[nodiscard]] Expected<nonlinear::Answer> solve_nonlinear(const pybind11::dict& problem,
                                                          const nonlinear::Settings& settings);

}  // namespace marble::python
