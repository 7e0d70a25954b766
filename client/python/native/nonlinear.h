// Nonlinear problems of Python functions, for the loop of marble::nonlinear.
#pragma once

#include <pybind11/pybind11.h>

#include "marble/retrospective.h"

namespace marble::python {

/// problem: `values`, `derivatives` and `hessian` (or None) as marble.nlp wraps them, and the arrays `start`,
/// `lower`, `upper`, `scale` and `blocks`. What a function raises goes through.
/// open: None, for ticks in process, without the GIL; or what opens a session for a problem, given as a dict
/// of n, c0, vectors and matrices (data, indices, indptr, rows) by their letters, and returns its tick: a
/// function of changes by letter, cold, and the seconds left (None: for ever), to (status, detail, z, y, ν,
/// ξ, η, b_stationary, stationarity, second_order, factorizations), or None where the time was up.
[[nodiscard]] Expected<nonlinear::Answer> solve_nonlinear(const pybind11::dict& problem,
                                                          const nonlinear::Settings& settings,
                                                          const pybind11::object& open);

/// The same level after level. use_samples: told N before a level; sample_cost: None, or the cost at x of a
/// sample by its number.
[[nodiscard]] Expected<nonlinear::RetrospectiveAnswer> solve_retrospective(
    const pybind11::dict& problem, const nonlinear::RetrospectiveSettings& settings,
    const pybind11::object& use_samples, const pybind11::object& sample_cost, const pybind11::object& open);

}  // namespace marble::python
