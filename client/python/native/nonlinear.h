// Provides nonlinear problems of Python functions, for the loop of marble::nonlinear.
#pragma once

#include <pybind11/pybind11.h>

#include "marble/retrospective.h"

namespace marble::python {

/// problem: `values`, `derivatives` and `hessian` (or None) as marble.nlp wraps them, and the arrays `start`,
/// `lower`, `upper`, `scale` and `blocks`. Exceptions of the functions propagate.
[[nodiscard]] nonlinear::Problem problem_of(const pybind11::dict& problem);

/// open: None, for LCQPs in process, without the GIL; or a function that opens a session for a problem, in
/// the form of dict_of, and returns its solve function. That takes changes by letter, cold, the seconds left
/// (None: no limit), the shift's blocks of the four kinds of vectors (first, count, by), z0 or None, and
/// whether it is an update's first part. It returns (a marble.Solution, whether it was reopened), or None if
/// the time was up or for a first part.
[[nodiscard]] nonlinear::OpenTicks ticks_of(const pybind11::object& open);

/// Solves a problem, with sessions from `open`.
[[nodiscard]] Expected<nonlinear::Answer> solve_nonlinear(const pybind11::dict& problem,
                                                          const nonlinear::Settings& settings,
                                                          const pybind11::object& open);

/// Solves sample-average stages one after the other. use_samples: called with N before a stage; sample_cost:
/// None, or the cost at x of a sample by its number.
[[nodiscard]] Expected<nonlinear::RetrospectiveAnswer> solve_retrospective(
    const pybind11::dict& problem, const nonlinear::RetrospectiveSettings& settings,
    const pybind11::object& use_samples, const pybind11::object& sample_cost, const pybind11::object& open);

}  // namespace marble::python
