// Converts options, shifts and kinds of curvature from and to the package's form.
#pragma once

#include <pybind11/pybind11.h>

#include <string>

#include "marble/nonlinear.h"
#include "marble/options.h"
#include "marble/restart.h"

namespace marble::python {

/// Sets names and values that the package has checked against the contract; their ranges are checked here.
void set_options(Options& options, const pybind11::dict& given);

/// Returns all options by their names: a copy of the defaults, which takes a tenth of the time, with the
/// differences.
[[nodiscard]] pybind11::dict dict_of(const Options& options);

/// Binds the options of each LCQP as the first argument of `open` of ticks_of. None stays None.
[[nodiscard]] pybind11::object with_options(const pybind11::object& open, const Options& lcqp);

/// Reads the blocks (first, count, by) of each of the four kinds of vectors; None: no shift.
[[nodiscard]] Shift shift_of(const pybind11::object& given);

/// Returns the curvature by its name.
[[nodiscard]] nonlinear::Curvature curvature_of(const std::string& name);

}  // namespace marble::python
