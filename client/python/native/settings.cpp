#include "settings.h"

#include <cstdint>
#include <string_view>
#include <vector>

#include "answers.h"

namespace marble::python {

namespace py = pybind11;

namespace {

py::object python_value(double value) { return py::float_(value); }
py::object python_value(std::int32_t value) { return py::int_(value); }
py::object python_value(bool value) { return py::bool_(value); }

/// Returns a choice by its name.
py::object choice_name(std::string_view option, std::size_t value) {
  for (const OptionInfo& info : option_table()) {
    if (info.name == option) return py::str(std::string(info.choices[value]));
  }
  return py::none();
}
py::object python_value(Path path) { return choice_name("path", static_cast<std::size_t>(path)); }
py::object python_value(Method method) { return choice_name("method", static_cast<std::size_t>(method)); }
py::object python_value(Retraction retraction) {
  return choice_name("retraction", static_cast<std::size_t>(retraction));
}

}  // namespace

void set_options(Options& options, const py::dict& given) {
  for (const auto& [name, value] : given) {
    const auto key = name.cast<std::string>();
    const auto set = py::isinstance<py::str>(value) ? set_option_text(options, key, value.cast<std::string>())
                                                    : set_option(options, key, value.cast<double>());
    if (!set) raise(set.error());
  }
}

py::dict dict_of(const Options& options) {
  static const Options usual;
  static PyObject* const usual_dict = [] {
    py::dict all;
#define MARBLE_OPTION(type, name, ...) all[#name] = python_value(usual.name);
#include "marble/options.def"
#undef MARBLE_OPTION
    return all.release().ptr();
  }();
  auto all = py::reinterpret_steal<py::dict>(PyDict_Copy(usual_dict));
  if (!all) throw py::error_already_set();
#define MARBLE_OPTION(type, name, ...) \
  if (options.name != usual.name) all[#name] = python_value(options.name);
#include "marble/options.def"
#undef MARBLE_OPTION
  return all;
}

py::object with_options(const py::object& open, const Options& lcqp) {
  if (open.is_none()) return open;
  return py::module_::import("functools").attr("partial")(open, dict_of(lcqp));
}

Shift shift_of(const py::object& given) {
  Shift shift;
  if (given.is_none()) return shift;
  const auto parts = given.cast<py::tuple>();
  std::vector<ShiftBlock>* const blocks[] = {&shift.variables, &shift.equalities, &shift.inequalities,
                                             &shift.pairs};
  for (std::size_t part = 0; part < 4; ++part) {
    for (const py::handle& block : parts[part]) {
      const auto numbers = block.cast<py::tuple>();
      blocks[part]->push_back({numbers[0].cast<Index>(), numbers[1].cast<Index>(), numbers[2].cast<Index>()});
    }
  }
  return shift;
}

nonlinear::Curvature curvature_of(const std::string& name) {
  using nonlinear::Curvature;
  if (name == "automatic") return Curvature::automatic;
  if (name == "exact") return Curvature::exact;
  if (name == "gauss_newton") return Curvature::gauss_newton;
  if (name == "bfgs") return Curvature::bfgs;
  if (name == "none") return Curvature::none;
  raise(invalid("curvature", name, "must be automatic, exact, gauss_newton, bfgs or none"));
}

}  // namespace marble::python
