// Provides planners of linear complementarity systems for Python.
#pragma once

#include <pybind11/pybind11.h>

namespace marble::python {

/// Binds marble._core.LcsPlanner(lcs, task, options) and lcs_rollout(lcs, x0, u), for marble.lcs.
void bind_lcs(pybind11::module_& module);

}  // namespace marble::python
