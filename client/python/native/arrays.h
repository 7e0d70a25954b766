// Borrowed views of Python's arrays, and arrays that take a vector over: nothing is copied either way.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <span>
#include <utility>
#include <vector>

#include "marble/problem.h"

namespace marble::python {

namespace py = pybind11;

/// Owns references to the arrays whose views it hands out. Contiguous ones of the right type are borrowed;
/// others are converted.
class Borrowed {
 public:
  [[nodiscard]] std::span<const double> doubles(const py::handle& values) { return view<double>(values); }
  [[nodiscard]] std::span<const Index> indices(const py::handle& values) { return view<Index>(values); }

  /// Of a csc_matrix with sorted entries; an empty view of one without rows or entries.
  [[nodiscard]] SparseMatrixView matrix(const py::handle& csc, std::size_t rows, std::size_t columns) {
    const std::span<const double> values = doubles(csc.attr("data"));
    if (rows == 0) return {};
    return {static_cast<Index>(rows), static_cast<Index>(columns), indices(csc.attr("indptr")),
            indices(csc.attr("indices")), values};
  }

  /// Of a marble.LCQP.
  [[nodiscard]] ProblemView problem(const py::handle& lcqp) {
    ProblemView view;
    view.hessian_form = HessianForm::upper_triangle;
    view.g = doubles(lcqp.attr("g"));
    view.b = doubles(lcqp.attr("b"));
    view.d = doubles(lcqp.attr("d"));
    view.l = doubles(lcqp.attr("l"));
    view.r = doubles(lcqp.attr("r"));
    view.c0 = lcqp.attr("c0").cast<double>();
    const std::size_t n = view.g.size();
    view.Q = matrix(lcqp.attr("Q"), n, n);
    if (view.Q.values.empty()) view.Q = {};
    view.A = matrix(lcqp.attr("A"), view.b.size(), n);
    view.C = matrix(lcqp.attr("C"), view.d.size(), n);
    view.L = matrix(lcqp.attr("L"), view.l.size(), n);
    view.R = matrix(lcqp.attr("R"), view.r.size(), n);
    return view;
  }

 private:
  template <class Number>
  [[nodiscard]] std::span<const Number> view(const py::handle& values) {
    auto array = py::array_t<Number, py::array::c_style | py::array::forcecast>::ensure(values);
    if (!array) throw py::error_already_set();
    const std::span<const Number> span(array.data(), static_cast<std::size_t>(array.size()));
    kept_.push_back(std::move(array));
    return span;
  }

  std::vector<py::object> kept_;
};

/// An array that owns what the vector held.
[[nodiscard]] inline py::array_t<double> array_of(std::vector<double>&& values) {
  if (values.empty()) return py::array_t<double>(0);
  auto* const owned = new std::vector<double>(std::move(values));
  const py::capsule owner(owned, [](void* data) { delete static_cast<std::vector<double>*>(data); });
  return py::array_t<double>(static_cast<py::ssize_t>(owned->size()), owned->data(), owner);
}

}  // namespace marble::python
