#include "sensitivity.h"

#include <pybind11/stl.h>

#include <string>
#include <utility>
#include <vector>

#include "answers.h"
#include "arrays.h"
#include "marble/sensitivity.h"

namespace marble::python {
namespace {

/// Derivatives of an answer. Keeps the problem, whose arrays it borrows.
class Derivatives {
 public:
  Derivatives(const py::object& lcqp, const py::object& answer)
      : sensitivity_(value_or_raise(
            Sensitivity::create(value_or_raise(Problem::create(arrays_.problem(lcqp))), solved(answer)))) {}

  py::dict along(const py::dict& direction) {
    Borrowed arrays;
    AnswerChange change = value_or_raise(sensitivity_.along(arrays.update(direction)));
    py::dict told;
    told["z"] = Numbers{std::move(change.z)};
    told["y"] = Numbers{std::move(change.equality_multipliers)};
    told["nu"] = Numbers{std::move(change.inequality_multipliers)};
    told["xi"] = Numbers{std::move(change.complementarity_multipliers_L)};
    told["eta"] = Numbers{std::move(change.complementarity_multipliers_R)};
    told["holds"] = change.holds;
    return told;
  }

  py::dict gradient(const py::dict& weights) {
    Borrowed arrays;
    AnswerWeights given;
    const std::pair<const char*, std::span<const double>*> kinds[] = {
        {"z", &given.z},
        {"y", &given.equality_multipliers},
        {"nu", &given.inequality_multipliers},
        {"xi", &given.complementarity_multipliers_L},
        {"eta", &given.complementarity_multipliers_R}};
    for (const auto& [name, span] : kinds) {
      if (weights.contains(name)) *span = arrays.doubles(weights[name]);
    }
    ProblemGradient gradient = value_or_raise(sensitivity_.gradient(given));
    py::dict told;
#define MARBLE_VECTOR(letter, field) told[#letter] = Numbers{std::move(gradient.letter)};
#define MARBLE_MATRIX(letter, field, values, rows) told[#letter] = Numbers{std::move(gradient.letter)};
#include "marble/contract.def"
    return told;
  }

  [[nodiscard]] std::vector<Index> weak_inequalities() const { return sensitivity_.weak_inequalities(); }
  [[nodiscard]] std::vector<Index> biactive_pairs() const { return sensitivity_.biactive_pairs(); }

 private:
  // The package has looked whether it is.
  static Solution solved(const py::object& answer) {
    Solution solution = *answer_of(answer);
    solution.status = Status::solved;
    return solution;
  }

  Borrowed arrays_;  // before what borrows of it
  Sensitivity sensitivity_;
};

}  // namespace

void bind_sensitivity(py::module_& module) {
  py::class_<Derivatives>(module, "Sensitivity")
      .def(py::init<const py::object&, const py::object&>())
      .def("along", &Derivatives::along)
      .def("gradient", &Derivatives::gradient)
      .def_property_readonly("weak_inequalities", &Derivatives::weak_inequalities)
      .def_property_readonly("biactive_pairs", &Derivatives::biactive_pairs);
}

}  // namespace marble::python
