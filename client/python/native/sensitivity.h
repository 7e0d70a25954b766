// Provides derivatives of solutions for Python.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <optional>

#include "arrays.h"
#include "marble/solution.h"

namespace marble::python {

/// A request for a solution's derivatives, with the arrays it borrows.
struct AskedDerivatives {
  Borrowed arrays;
  SensitivityRequest request;
};
/// Converts a marble.model.derivatives.Asked; null for None.
[[nodiscard]] std::shared_ptr<const AskedDerivatives> asked_derivatives(const py::object& asked);

/// Returns None; or a dictionary with the error, or with the fields of SensitivityAnswer by their names.
[[nodiscard]] py::object derivatives_reported(std::optional<Expected<SensitivityAnswer>> sensitivity);

/// Binds marble._core.Sensitivity(problem, answer): `along` takes and `gradient` returns numbers by the
/// letters of the equation, `along` returns and `gradient` takes vectors of the solution by theirs.
void bind_sensitivity(pybind11::module_& module);

}  // namespace marble::python
