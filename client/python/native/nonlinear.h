// Nonlinear problems of Python functions, for the loop of marble::nonlinear.
#pragma once

#include <pybind11/pybind11.h>

#include "marble/retrospective.h"

namespace marble::python {

/// problem: `values`, `derivatives` and `hessian` (or None) as marble.nlp wraps them, and the arrays `start`,
/// `lower`, `upper`, `scale` and `blocks`. What a function raises goes through.
[[nodiscard]] nonlinear::Problem problem_of(const pybind11::dict& problem);

/// open: None, for ticks in process, without the GIL; or what opens a session for a problem, given as dict_of
/// has it, and returns its tick: a function of changes by letter, cold, the seconds left (None: for ever),
/// the shift's blocks of the four kinds of vectors (first, count, by), z0 or None, and whether it is an
/// update's first part, to (a marble.Solution, whether it was reopened); None where the time was up, and of a
/// first part.
[[nodiscard]] nonlinear::OpenTicks ticks_of(const pybind11::object& open);

/// A problem, where open says.
[[nodiscard]] Expected<nonlinear::Answer> solve_nonlinear(const pybind11::dict& problem,
                                                          const nonlinear::Settings& settings,
                                                          const pybind11::object& open);

/// The same level after level. use_samples: told N before a level; sample_cost: None, or the cost at x of a
/// sample by its number.
[[nodiscard]] Expected<nonlinear::RetrospectiveAnswer> solve_retrospective(
    const pybind11::dict& problem, const nonlinear::RetrospectiveSettings& settings,
    const pybind11::object& use_samples, const pybind11::object& sample_cost, const pybind11::object& open);

}  // namespace marble::python
