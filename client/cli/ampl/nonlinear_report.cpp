#include "ampl/nonlinear_report.h"

#include <algorithm>

#include "marble/solver.h"
#include "output/json.h"
#include "output/text_table.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

constexpr int kRowsBetweenHeaders = 40;

}  // namespace

void NonlinearTable::report(const nonlinear::Iteration& i) {
  if (rows_++ % kRowsBetweenHeaders == 0) {
    std::fprintf(
        to_, "%s iter      objective violation      step    radius predicted    actual     shift LCQPs%s\n",
        colours_ ? "\033[1m" : "", colours_ ? "\033[0m" : "");
  }
  std::fprintf(to_, "%5d %14.7e %9.2e %9.2e %9.2e %9.2e %9.2e %9.2e %5d%s%s%s\n", i.iteration,
               sign_ * i.objective + 0.0, i.violation, i.step, i.radius, i.predicted, i.actual, i.shift,
               i.ticks, i.restoring ? " restoring" : (i.elastic ? " elastic" : ""),
               i.corrected ? " corrected" : "", i.accepted ? "" : " refused");
}

NonlinearVectors NonlinearVectors::of(const formats::NlNonlinear& nl, const nonlinear::Answer& answer) {
  const auto n = static_cast<std::size_t>(nl.variables);
  const formats::MultiplierView multipliers = formats::multipliers_of(answer);
  NonlinearVectors made;
  made.x.assign(answer.x.begin(), answer.x.begin() + nl.variables);
  made.duals = formats::sums(nl.row_duals, static_cast<std::size_t>(nl.constraints), multipliers, nl.sign());
  const auto of_bounds = [&](bool lower, bool upper) {
    std::vector<formats::DualTerm> terms;
    for (const formats::DualTerm& term : nl.reduced_costs) {
      if (term.sign > 0.0 ? lower : upper) terms.push_back(term);
    }
    std::vector<double> values = formats::sums(terms, n, multipliers, nl.sign());
    for (std::size_t j = 0; j < n && j < answer.multipliers.bounds.size(); ++j) {
      const double bound = answer.multipliers.bounds[j];
      if (bound > 0.0 ? lower : upper) values[j] += nl.sign() * bound;
    }
    return values;
  };
  made.reduced_costs = of_bounds(true, true);
  made.lower_bound_duals = of_bounds(true, false);
  made.upper_bound_duals = of_bounds(false, true);
  return made;
}

std::string summary(const formats::NlNonlinear& nl, const nonlinear::Answer& a, double seconds) {
  const auto number = [](std::size_t value) { return std::to_string(value); };
  std::string text = without_controls(nl.name) + ": " + to_string(a.status);
  text += "  (" + number(a.x.size()) + " variables, " + number(nl.equalities) + " equalities, " +
          number(nl.inequalities) + " inequalities, " + number(nl.pairs) + " pairs; nonlinear)\n";
  text += "  objective       " + formatted("%.10g", nl.sign() * a.objective + 0.0) + "\n";
  text += "  violation       " + formatted("%.1e", a.violation) + "\n";
  text += "  kkt residual    " + formatted("%.1e", a.kkt_residual) + "\n";
  text += "  work            " + std::to_string(a.iterations) + " iterations, " + std::to_string(a.ticks) +
          " LCQPs, " + std::to_string(a.factorizations) + " factorizations, " +
          std::to_string(a.evaluations) + " evaluations\n";
  text += "  time            " + formatted("%.3f", 1e3 * seconds) + " ms\n";
  if (is_solved(a.status)) {
    text += std::string("  stationarity    ") + to_string(a.stationarity) +
            (a.b_stationary.value_or(false) ? ", no descent on any branch\n" : "\n");
  } else {
    text += "  why             " + without_controls(a.detail) + "\n";
    text += std::string("  what to try     ") + advice(a.status) + "\n";
  }
  return text;
}

std::string json_line(const std::string& file, const formats::NlNonlinear& nl, const nonlinear::Answer& a,
                      double seconds) {
  const NonlinearVectors vectors = NonlinearVectors::of(nl, a);
  Json json;
  json["name"] = nl.name;
  json["file"] = file;
  json["status"] = to_string(a.status);
  json["detail"] = a.detail;
  json["nonlinear"] = true;
  json["objective"] = nl.sign() * a.objective + 0.0;
  json["violation"] = a.violation;
  json["kkt_residual"] = a.kkt_residual;
  json["x"] = vectors.x;
  json["duals"] = vectors.duals;
  json["reduced_costs"] = vectors.reduced_costs;
  json["stationarity"] = to_string(a.stationarity);
  if (a.b_stationary) json["b_stationary"] = *a.b_stationary;
  json["iterations"] = a.iterations;
  json["ticks"] = a.ticks;
  json["factorizations"] = a.factorizations;
  json["evaluations"] = a.evaluations;
  json["total_seconds"] = seconds;
  return line(json);
}

}  // namespace marble::cli
