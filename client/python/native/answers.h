// Errors of core as exceptions of Python, and answers that Python gives back.
#pragma once

#include <pybind11/pybind11.h>

#include <optional>
#include <utility>

#include "marble/error.h"
#include "marble/solution.h"

namespace marble::python {

/// marble._core.Fault, an exception whose args are code, field, index (-1: none), value, bound and the whole
/// sentence.
void make_fault(pybind11::module_& module);

/// What its args are of this error.
[[nodiscard]] pybind11::tuple fault_arguments(const Error& error);

[[noreturn]] void raise(const Error& error);

template <class T>
T value_or_raise(Expected<T> expected) {
  if (!expected) raise(expected.error());
  return std::move(*expected);
}

/// Of (z, y, nu, xi, eta, cold objective), or None.
[[nodiscard]] std::optional<Solution> answer_of(const pybind11::object& given);

}  // namespace marble::python
