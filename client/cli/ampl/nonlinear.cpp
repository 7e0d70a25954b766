#include "ampl/nonlinear.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <utility>

#include "marble/client.h"
#include "marble/solver.h"
#include "output/json.h"
#include "output/text_table.h"
#include "plain_text.h"

namespace marble::cli {
namespace {

using nonlinear::Curvature;
using nonlinear::Settings;

constexpr std::pair<const char*, double Settings::*> kNumbers[] = {
    {"step_tolerance", &Settings::step_tolerance},
    {"feasibility_tolerance", &Settings::feasibility_tolerance},
    {"radius", &Settings::radius},
    {"largest_radius", &Settings::largest_radius},
};
constexpr std::pair<const char*, Curvature> kCurvatures[] = {
    {"exact", Curvature::exact}, {"bfgs", Curvature::bfgs}, {"none", Curvature::none}};

template <class Number>
bool read_number(const std::string& text, Number& number) {
  const char* const end = text.data() + text.size();
  const auto [stopped, code] = std::from_chars(text.data(), end, number);
  return code == std::errc() && stopped == end;
}

}  // namespace

std::span<const NonlinearWord> nonlinear_words() {
  static constexpr NonlinearWord kWords[] = {
      {"step_tolerance", "of a nonlinear file: longest step of a solved point", "1e-08"},
      {"feasibility_tolerance", "of a nonlinear file: largest violation of a solved point", "1e-06"},
      {"radius", "of a nonlinear file: the first one of the trust region", "1"},
      {"largest_radius", "of a nonlinear file: that the trust region may have", "1e+06"},
      {"iteration_limit", "of a nonlinear file: linearisations before it ends", "200"},
      {"curvature", "of a nonlinear file: exact, bfgs or none", "exact"},
      {"nonlinear_method", "of a nonlinear file: sqpcc, slp, penalty, alag or barrier", "sqpcc"},
  };
  return kWords;
}

bool is_nonlinear_word(std::string_view name) {
  return std::ranges::any_of(nonlinear_words(), [&](const NonlinearWord& word) { return word.name == name; });
}

Expected<void> set_nonlinear_text(Settings& settings, const std::string& name, const std::string& value) {
  for (const auto& [word, member] : kNumbers) {
    if (name != word) continue;
    if (read_number(value, settings.*member) && settings.*member > 0.0) return {};
    return unexpected(invalid(name, value, "must be a number > 0"));
  }
  if (name == "iteration_limit") {
    if (read_number(value, settings.iteration_limit) && settings.iteration_limit >= 0) return {};
    return unexpected(invalid(name, value, "must be an integer >= 0"));
  }
  if (name == "nonlinear_method") {
    MARBLE_ASSIGN_OR_RETURN(const auto method, nonlinear::method_of(value));
    return settings.method = method, Expected<void>{};
  }
  if (name == "curvature") {
    for (const auto& [word, curvature] : kCurvatures) {
      if (value == word) return settings.curvature = curvature, Expected<void>{};
    }
    return unexpected(invalid(name, value, "must be exact, bfgs or none"));
  }
  MARBLE_RETURN_IF_ERROR(set_option_text(settings.lcqp, name, value));
  if (name == "time_limit_s") {
    const double all = std::exchange(settings.lcqp.time_limit_s, Options().time_limit_s);
    settings.time_limit_s = std::max(all, std::numeric_limits<double>::min());
  }
  return {};
}

Expected<nonlinear::Answer> solve_nonlinear(const formats::NlNonlinear& nl,
                                            const nonlinear::Settings& settings,
                                            const ServerArguments* server) {
  const auto solve = [&]() -> Expected<nonlinear::Answer> {
    if (server == nullptr) return nonlinear::solve(nl.problem, nonlinear::open_ticks_in_process, settings);
    MARBLE_ASSIGN_OR_RETURN(const auto client, connect(*server));
    return nonlinear::solve(nl.problem, client, settings);
  };
  auto answer = solve();
  if (answer) return answer;
  Error error = nl.named(std::move(answer.error()));
  if (server != nullptr && error.code != ErrorCode::invalid_argument)
    error.bound += " (server " + server->server + ")";
  return unexpected(std::move(error));
}

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
