// Provides real-time iteration for Python.
#pragma once

#include <pybind11/pybind11.h>

namespace marble::python {

/// Binds marble._core.RealTimeLoop(problem, settings, options, open), for marble.nlp.RealTime.
void bind_real_time(pybind11::module_& module);

}  // namespace marble::python
