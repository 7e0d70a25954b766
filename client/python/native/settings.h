// Options, shifts and kinds of curvature, as the package says them.
#pragma once

#include <pybind11/pybind11.h>

#include <string>

#include "marble/nonlinear.h"
#include "marble/options.h"
#include "marble/restart.h"

namespace marble::python {

/// Names and values that the package has checked by the contract; their ranges are checked here.
void set_options(Options& options, const pybind11::dict& given);

/// All options by their names: a copy of the defaults, which takes a tenth of the time, with what differs.
[[nodiscard]] pybind11::dict dict_of(const Options& options);

/// `open` of ticks_of, which is given the options of each LCQP first. None stays.
[[nodiscard]] pybind11::object with_options(const pybind11::object& open, const Options& lcqp);

/// Of each of the four kinds of vectors its blocks (first, count, by); None: nothing moves.
[[nodiscard]] Shift shift_of(const pybind11::object& given);

/// By its name.
[[nodiscard]] nonlinear::Curvature curvature_of(const std::string& name);

}  // namespace marble::python
