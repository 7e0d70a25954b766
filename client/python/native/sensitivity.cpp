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

AnswerWeights weights_of(Borrowed& arrays, const py::dict& weights) {
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
  return given;
}

template <class Vectors>
py::dict vectors_reported(Vectors& vectors) {
  py::dict reported;
  reported["z"] = Numbers{std::move(vectors.z)};
  reported["y"] = Numbers{std::move(vectors.equality_multipliers)};
  reported["nu"] = Numbers{std::move(vectors.inequality_multipliers)};
  reported["xi"] = Numbers{std::move(vectors.complementarity_multipliers_L)};
  reported["eta"] = Numbers{std::move(vectors.complementarity_multipliers_R)};
  return reported;
}

template <class Gradient>
py::dict numbers_reported(Gradient& gradient) {
  py::dict reported;
#define MARBLE_VECTOR(letter, field) reported[#letter] = Numbers{std::move(gradient.letter)};
#define MARBLE_MATRIX(letter, field, values, rows) reported[#letter] = Numbers{std::move(gradient.letter)};
#include "marble/contract.def"
  return reported;
}

py::tuple response_reported(RowResponse response) {
  return py::make_tuple(Numbers{std::move(response.values)}, Numbers{std::move(response.free)},
                        Numbers{std::move(response.response)}, Numbers{std::move(response.z)},
                        Numbers{std::move(response.columns)});
}

/// Derivatives of a solution.
class Derivatives {
 public:
  Derivatives(const py::object& lcqp, const py::object& answer) : Derivatives(Borrowed(), lcqp, answer) {}

  py::dict along(const py::dict& direction) {
    Borrowed arrays;
    AnswerChange change = value_or_raise(sensitivity_.along(arrays.update(direction)));
    py::dict reported = vectors_reported(change);
    reported["active_set_constant"] = change.active_set_constant;
    return reported;
  }

  py::dict gradient(const py::dict& weights) {
    Borrowed arrays;
    ProblemGradient gradient = value_or_raise(sensitivity_.gradient(weights_of(arrays, weights)));
    return numbers_reported(gradient);
  }

  py::tuple rows(const py::object& asked) {
    return response_reported(value_or_raise(sensitivity_.rows(*asked_derivatives(asked)->request.rows)));
  }

  [[nodiscard]] std::vector<Index> weak_inequalities() const { return sensitivity_.weak_inequalities(); }
  [[nodiscard]] std::vector<Index> biactive_pairs() const { return sensitivity_.biactive_pairs(); }

 private:
  Derivatives(Borrowed arrays, const py::object& lcqp, const py::object& answer)
      : sensitivity_(value_or_raise(
            Sensitivity::create(value_or_raise(Problem::create(arrays.problem(lcqp))), solved(answer)))) {}

  // The package has checked that it is solved.
  static Solution solved(const py::object& answer) {
    Solution solution = *answer_of(answer);
    solution.status = Status::solved;
    return solution;
  }

  Sensitivity sensitivity_;
};

}  // namespace

std::shared_ptr<const AskedDerivatives> asked_derivatives(const py::object& asked) {
  if (asked.is_none()) return nullptr;
  auto made = std::make_shared<AskedDerivatives>();
  Borrowed& arrays = made->arrays;
  SensitivityRequest& request = made->request;
  if (const py::object E = asked.attr("rows"); !E.is_none()) {
    const auto shape = E.attr("shape").cast<std::pair<std::size_t, std::size_t>>();
    request.rows = RowsRequest{.E = arrays.matrix(E, shape.first, shape.second),
                               .proximal = arrays.doubles(asked.attr("proximal")),
                               .g = arrays.doubles(asked.attr("g")),
                               .columns = asked.attr("columns").cast<bool>()};
  }
  request.directions = {asked.attr("directions").cast<Index>(), arrays.update(asked.attr("numbers"))};
  request.losses = {asked.attr("losses").cast<Index>(), weights_of(arrays, asked.attr("weights"))};
  return made;
}

py::object derivatives_reported(std::optional<Expected<SensitivityAnswer>> sensitivity) {
  if (!sensitivity) return py::none();
  py::dict reported;
  if (!*sensitivity) {
    reported["error"] = fault_arguments(sensitivity->error());
    return reported;
  }
  SensitivityAnswer& answer = **sensitivity;
  reported["weak_inequalities"] = answer.weak_inequalities;
  reported["biactive_pairs"] = answer.biactive_pairs;
  if (answer.rows && *answer.rows) reported["rows"] = response_reported(std::move(**answer.rows));
  if (answer.rows && !*answer.rows) reported["rows_error"] = fault_arguments(answer.rows->error());
  reported["active_set_constant"] = answer.changes.active_set_constant;
  reported["undefined_changes"] = answer.changes.undefined;
  reported["changes"] = vectors_reported(answer.changes);
  reported["undefined_gradients"] = answer.gradients.undefined;
  reported["gradients"] = numbers_reported(answer.gradients);
  reported["factorizations"] = answer.factorizations;
  reported["back_substitutions"] = answer.back_substitutions;
  return reported;
}

void bind_sensitivity(py::module_& module) {
  py::class_<Derivatives>(module, "Sensitivity")
      .def(py::init<const py::object&, const py::object&>())
      .def("along", &Derivatives::along)
      .def("gradient", &Derivatives::gradient)
      .def("rows", &Derivatives::rows)
      .def_property_readonly("weak_inequalities", &Derivatives::weak_inequalities)
      .def_property_readonly("biactive_pairs", &Derivatives::biactive_pairs);
}

}  // namespace marble::python
