// Derivatives of answers for Python.
#pragma once

#include <pybind11/pybind11.h>

namespace marble::python {

/// marble._core.Sensitivity(problem, answer): `along` takes and `gradient` gives numbers by the letters of
/// the equation, `along` gives and `gradient` takes vectors of the answer by theirs.
void bind_sensitivity(pybind11::module_& module);

}  // namespace marble::python
