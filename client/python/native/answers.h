// Converts errors of core to Python exceptions, and problems and solutions in both directions.
#pragma once

#include <pybind11/pybind11.h>

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "arrays.h"
#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/solution.h"

namespace marble::python {

/// Creates marble._core.Fault, an exception whose args are code, field, index (-1: none), value, bound and
/// the whole sentence.
void make_fault(pybind11::module_& module);

/// Returns its args for this error.
[[nodiscard]] pybind11::tuple fault_arguments(const Error& error);

[[noreturn]] void raise(const Error& error);

template <class T>
T value_or_raise(Expected<T> expected) {
  if (!expected) raise(expected.error());
  return std::move(*expected);
}

/// Converts (z, y, nu, xi, eta, cold objective), or None.
[[nodiscard]] std::optional<Solution> answer_of(const pybind11::object& given);

/// Converts a marble.Solution: the fields of solution.def without times, sensitivity and conflict.
[[nodiscard]] Solution solution_of(const pybind11::object& answer);
/// Converts a solution to the fields of a marble.Solution except `problem` and `job_id`; `options` as used,
/// total_s: from the call to the solution.
[[nodiscard]] pybind11::dict dict_of(Solution solution, const Options& options, double total_s);

/// Returns c0, and vectors and matrices (data, indices, indptr, rows) by their letters.
[[nodiscard]] pybind11::dict dict_of(const ProblemView& problem);
/// Returns c0, vectors and values of matrices by their letters, only those that are set.
[[nodiscard]] pybind11::dict dict_of(const ProblemUpdate& update);

/// Copies an array.
[[nodiscard]] std::vector<double> owned(const pybind11::handle& values);
[[nodiscard]] Numbers copied(std::span<const double> values);

}  // namespace marble::python
