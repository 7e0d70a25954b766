#include "nonlinear.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"

namespace marble::python {
namespace {

Numbers copied(std::span<const double> values) { return {{values.begin(), values.end()}}; }

/// The views of what one function gave last, and the arrays they borrow.
struct Given {
  py::object kept;
  std::optional<Borrowed> arrays;

  const py::object& keep(py::object object) {
    arrays.emplace();
    kept = std::move(object);
    return kept;
  }
  SparseMatrixView matrix(const py::handle& csc) {
    if (csc.is_none()) return {};
    const auto shape = csc.attr("shape").cast<std::pair<std::size_t, std::size_t>>();
    return arrays->matrix(csc, shape.first, shape.second);
  }
};

class ReleasedTicks final : public nonlinear::Ticks {
 public:
  explicit ReleasedTicks(std::unique_ptr<nonlinear::Ticks> ticks) : ticks_(std::move(ticks)) {}
  Expected<Solution> solve(const ProblemUpdate& update, const nonlinear::TickControls& controls) override {
    const py::gil_scoped_release no_gil;
    return ticks_->solve(update, controls);
  }

 private:
  std::unique_ptr<nonlinear::Ticks> ticks_;
};

Expected<std::unique_ptr<nonlinear::Ticks>> open(const ProblemView& view,
                                                 const nonlinear::Settings& settings) {
  auto ticks = nonlinear::open_ticks_in_process(view, settings);
  if (!ticks) return unexpected(std::move(ticks.error()));
  return std::make_unique<ReleasedTicks>(std::move(*ticks));
}

std::vector<double> numbers(const py::dict& problem, const char* name) {
  Borrowed arrays;
  const auto view = arrays.doubles(problem[name]);
  return {view.begin(), view.end()};
}

}  // namespace

Expected<nonlinear::Answer> solve_nonlinear(const py::dict& problem, const nonlinear::Settings& settings) {
  nonlinear::Problem made;
  Given values, derivatives, hessian;
  made.values = [&](std::span<const double> x) -> nonlinear::Values {
    const auto parts = py::tuple(values.keep(problem["values"](copied(x))));
    Borrowed& arrays = *values.arrays;
    return {parts[0].cast<double>(),  arrays.doubles(parts[1]), arrays.doubles(parts[2]),
            arrays.doubles(parts[3]), arrays.doubles(parts[4]), arrays.doubles(parts[5])};
  };
  made.derivatives = [&](std::span<const double> x) -> nonlinear::Derivatives {
    Given& given = derivatives;
    const auto parts = py::tuple(given.keep(problem["derivatives"](copied(x))));
    return {given.arrays->doubles(parts[0]), given.matrix(parts[1]), given.matrix(parts[2]),
            given.matrix(parts[3]),          given.matrix(parts[4]), given.matrix(parts[5])};
  };
  if (!problem["hessian"].is_none()) {
    made.hessian = [&](std::span<const double> x, const nonlinear::Multipliers& m) {
      const py::object upper = problem["hessian"](copied(x), copied(m.equalities), copied(m.inequalities),
                                                  copied(m.G), copied(m.H));
      return hessian.matrix(hessian.keep(upper));
    };
  }
  made.start = numbers(problem, "start"), made.lower = numbers(problem, "lower");
  made.upper = numbers(problem, "upper"), made.scale = numbers(problem, "scale");
  Borrowed arrays;
  const auto blocks = arrays.indices(problem["blocks"]);
  made.blocks.assign(blocks.begin(), blocks.end());
  return nonlinear::solve(made, open, settings);
}

}  // namespace marble::python
