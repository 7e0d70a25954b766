// Borrows views of Python's arrays, and lets Python view vectors: nothing is copied in either direction. Uses
// only the buffer protocol, which every version of numpy supports: pybind11's own array type reads numpy's
// structures, and an older pybind11 misreads those of numpy 2.
#pragma once

#include <pybind11/pybind11.h>

#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "marble/problem.h"

namespace marble::python {

namespace py = pybind11;

/// Owns references to the arrays that it views. Contiguous arrays of the right type are borrowed; others are
/// converted.
class Borrowed {
 public:
  [[nodiscard]] std::span<const double> doubles(const py::handle& values) { return view<double>(values); }
  [[nodiscard]] std::span<const Index> indices(const py::handle& values) { return view<Index>(values); }

  /// Views a csc_matrix with sorted entries; returns an empty view if it has no rows or entries.
  [[nodiscard]] SparseMatrixView matrix(const py::handle& csc, std::size_t rows, std::size_t columns) {
    const std::span<const double> values = doubles(csc.attr("data"));
    if (rows == 0) return {};
    return {static_cast<Index>(rows), static_cast<Index>(columns), indices(csc.attr("indptr")),
            indices(csc.attr("indices")), values};
  }

  /// Views a marble.LCQP.
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

  /// Views new numbers by the letters of the equation, for a matrix its values. The dictionary must outlive
  /// the view.
  [[nodiscard]] ProblemUpdate update(const py::dict& changes) {
    ProblemUpdate update;
    for (const auto& [key, value] : changes) {
      const auto name = key.cast<std::string>();
      if (name == "c0") {
        update.c0 = value.cast<double>();
        continue;
      }
#define MARBLE_VECTOR(letter, field) \
  if (name == #letter) update.letter = doubles(value);
#define MARBLE_MATRIX(letter, field, values, rows) \
  if (name == #letter) update.letter = doubles(value);
#include "marble/contract.def"
    }
    return update;
  }

 private:
  class Buffer {
   public:
    Buffer() = default;
    Buffer(Buffer&& other) noexcept : buffer_(std::exchange(other.buffer_, {})) {}
    Buffer& operator=(Buffer&&) = delete;
    ~Buffer() { PyBuffer_Release(&buffer_); }
    /// Returns whether the object has contiguous items of that kind.
    [[nodiscard]] bool take(const py::handle& values, char format, std::size_t size) {
      if (PyObject_GetBuffer(values.ptr(), &buffer_, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) != 0) {
        PyErr_Clear();
        return false;
      }
      return buffer_.format != nullptr && buffer_.format[0] == format && buffer_.format[1] == 0 &&
             static_cast<std::size_t>(buffer_.itemsize) == size;
    }
    template <class Number>
    [[nodiscard]] std::span<const Number> items() const {
      return {static_cast<const Number*>(buffer_.buf),
              static_cast<std::size_t>(buffer_.len) / sizeof(Number)};
    }

   private:
    Py_buffer buffer_ = {};
  };

  template <class Number>
  [[nodiscard]] std::span<const Number> view(const py::handle& values) {
    constexpr bool kReal = std::is_same_v<Number, double>;
    Buffer buffer;
    if (!buffer.take(values, kReal ? 'd' : 'i', sizeof(Number))) {
      const py::object array =
          py::module_::import("numpy").attr("ascontiguousarray")(values, kReal ? "float64" : "int32");
      Buffer converted;
      if (!converted.take(array, kReal ? 'd' : 'i', sizeof(Number)))
        throw py::type_error("no array of numbers");
      kept_.push_back(std::move(converted));  // keeps the original array too
    } else {
      kept_.push_back(std::move(buffer));
    }
    return kept_.back().items<Number>();
  }

  std::vector<Buffer> kept_;
};

/// A vector that Python may view as an array, and that lives as long as the view.
struct Numbers {
  std::vector<double> values;
};

}  // namespace marble::python
