#include "answers.h"

#include <vector>

#include "arrays.h"

namespace marble::python {
namespace {

PyObject* fault_type = nullptr;

}  // namespace

void make_fault(py::module_& module) {
  fault_type = PyErr_NewException("marble._core.Fault", PyExc_Exception, nullptr);
  module.attr("Fault") = py::reinterpret_borrow<py::object>(fault_type);
}

py::tuple fault_arguments(const Error& error) {
  return py::make_tuple(to_string(error.code), error.field, error.index, error.value, error.bound,
                        error.message());
}

void raise(const Error& error) {
  PyErr_SetObject(fault_type, fault_arguments(error).ptr());
  throw py::error_already_set();
}

std::optional<Solution> answer_of(const py::object& given) {
  if (given.is_none()) return {};
  const auto parts = given.cast<py::tuple>();
  Solution start;
  std::vector<double>* const vectors[] = {&start.z, &start.equality_multipliers,
                                          &start.inequality_multipliers, &start.complementarity_multipliers_L,
                                          &start.complementarity_multipliers_R};
  Borrowed arrays;
  std::size_t place = 0;
  for (std::vector<double>* const vector : vectors) {
    const std::span<const double> values = arrays.doubles(parts[place++]);
    vector->assign(values.begin(), values.end());
  }
  start.cold_objective = parts[place].cast<double>();
  return start;
}

}  // namespace marble::python
