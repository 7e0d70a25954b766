// Derivatives of answers for Python.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <optional>

#include "arrays.h"
#include "marble/solution.h"

namespace marble::python {

/// What is asked of an answer's derivatives, with the arrays it borrows.
struct AskedDerivatives {
  Borrowed arrays;
  SensitivityRequest request;
};
/// Of a marble.model.derivatives.Asked; null of None.
[[nodiscard]] std::shared_ptr<const AskedDerivatives> asked_derivatives(const py::object& asked);

/// None; or a dictionary with the error, or with what SensitivityAnswer has, by its names.
[[nodiscard]] py::object derivatives_told(std::optional<Expected<SensitivityAnswer>> sensitivity);

/// marble._core.Sensitivity(problem, answer): `along` takes and `gradient` gives numbers by the letters of
/// the equation, `along` gives and `gradient` takes vectors of the answer by theirs.
void bind_sensitivity(pybind11::module_& module);

}  // namespace marble::python
