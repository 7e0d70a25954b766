#include "research/contestant.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

#include "base/program.h"
#include "marble/research/methods.h"
#include "output/json.h"
#include "output/text_table.h"

namespace marble::cli {
namespace {

// M z + offset
std::vector<double> rows_at(const SparseMatrix& m, const std::vector<double>& offset,
                            std::span<const double> z) {
  std::vector<double> rows = offset;
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      rows[m.row_indices[k]] += m.values[k] * z[j];
  }
  return rows;
}

// zᵀQz, with Q given in full or by its upper triangle.
double quadratic(const OwnedProblem& p, std::span<const double> z) {
  const bool half = p.hessian_form == HessianForm::upper_triangle;
  double sum = 0.0;
  for (Index j = 0; j < p.Q.columns; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      const Index i = p.Q.row_indices[k];
      sum += (half && i != j ? 2.0 : 1.0) * p.Q.values[k] * z[i] * z[j];
    }
  }
  return sum;
}

}  // namespace

bool Measures::feasible(double tolerance, PairMeasure pairs) const {
  const bool by_product = pairs == PairMeasure::product && !std::isnan(product);
  return std::max({equality, inequality, by_product ? product : smaller_side}) <= tolerance;
}

Measures measure(const OwnedProblem& p, std::span<const double> z) {
  Measures m;
  m.objective = 0.5 * quadratic(p, z) + p.c0;
  for (std::size_t j = 0; j < p.g.size(); ++j) m.objective += p.g[j] * z[j];
  for (const double row : rows_at(p.A, p.b, z)) m.equality = std::max(m.equality, std::abs(row));
  for (const double row : rows_at(p.C, p.d, z)) m.inequality = std::max(m.inequality, -row);
  const std::vector<double> s = rows_at(p.L, p.l, z), t = rows_at(p.R, p.r, z);
  for (std::size_t i = 0; i < s.size(); ++i) {
    m.inequality = std::max({m.inequality, -s[i], -t[i]});
    m.smaller_side = std::max(m.smaller_side, std::abs(std::min(s[i], t[i])));
    m.product = std::max(m.product, std::abs(s[i] * t[i]));
  }
  return m;
}

namespace {

constexpr double kGrace = 5.0;  // seconds: a peer needs time to start and to write

struct Named {
  std::string name, rest;
};

Expected<Named> split(const std::string& flag, const std::string& text, const char* form) {
  const std::size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  if (name.empty()) return unexpected(invalid(flag, text, form));
  return Named{name, colon == std::string::npos ? "" : text.substr(colon + 1)};
}

Attempt failed(std::string fault) {
  Attempt attempt;
  attempt.status = "failed";
  attempt.fault = std::move(fault);
  return attempt;
}

Attempt solve_by(const Options& options, const OwnedProblem& problem, double time_limit_s,
                 const std::stop_token& stop) {
  Options limited = options;
  limited.time_limit_s = std::min(limited.time_limit_s, time_limit_s);
  SolveControls controls;
  controls.stop = stop;
  controls.initial_z = problem.initial_z;
  auto solution = research::solve_in_process(problem.view(), limited, controls);
  if (!solution) return failed(solution.error().message());
  return {to_string(solution->status), "",
          std::move(solution->z),      solution->times.setup_s + solution->times.solve_s,
          solution->iterations,        solution->factorizations};
}

std::string last_line(const std::string& text) {
  std::string last;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) last = line;
  }
  return last;
}

// Reads a peer's output; any malformed output is a fault of the peer.
Attempt read_answer(const std::string& out, std::size_t variables, double wall_s) {
  const nlohmann::json answer = parsed<nlohmann::json>(last_line(out));
  if (!answer.is_object())
    return failed("its last line is no JSON object: " + terminal_text(last_line(out), 100));
  Attempt attempt;
  try {
    attempt.status = terminal_text(answer.value("status", "answered"), 40);
    attempt.seconds = answer.value("seconds", wall_s);
    if (answer.contains("z") && !answer["z"].is_null()) attempt.z = answer["z"].get<std::vector<double>>();
  } catch (const nlohmann::json::exception&) {
    return failed("status must be text, seconds a number, z a list of numbers");
  }
  const auto finite = [](double value) { return std::isfinite(value); };
  if (!attempt.z.empty() && (attempt.z.size() != variables || !std::ranges::all_of(attempt.z, finite)))
    return failed("z must have " + std::to_string(variables) + " finite numbers");
  return attempt;
}

Attempt ask(const Peer& peer, const OwnedProblem& problem, const std::string& file, double time_limit_s,
            const std::stop_token& stop) {
  const std::string limit = formatted("%g", time_limit_s);
  const auto begun = std::chrono::steady_clock::now();
  auto end = run_program(
      {"/bin/sh", "-c",
       "MARBLE_TIME_LIMIT_S=" + limit + "; export MARBLE_TIME_LIMIT_S; " + peer.command + " \"$1\"", "sh",
       file},
      "", {time_limit_s + kGrace, stop});
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  if (!end) return failed(end.error().message());
  if (end->killed) return failed(stop.stop_requested() ? "interrupted" : "took too long");
  if (!end->well) return failed("did not end well: " + terminal_text(last_line(end->err), 200));
  return read_answer(end->out, problem.g.size(), wall_s);
}

}  // namespace

Expected<Contestant> contestant_by_options(const std::string& flag, const std::string& text,
                                           const Options& base) {
  MARBLE_ASSIGN_OR_RETURN(const auto named, split(flag, text, "must be NAME or NAME: OPTION=VALUE ..."));
  Options options = base;
  std::istringstream words(named.rest);
  for (std::string word; words >> word;) {
    const std::size_t equals = word.find('=');
    if (equals == std::string::npos) return unexpected(invalid(flag, word, "must be OPTION=VALUE"));
    MARBLE_RETURN_IF_ERROR(set_option_text(options, word.substr(0, equals), word.substr(equals + 1)));
  }
  return Contestant{named.name, options};
}

Expected<Contestant> contestant_by_command(const std::string& flag, const std::string& text) {
  MARBLE_ASSIGN_OR_RETURN(const auto named, split(flag, text, "must be NAME: COMMAND"));
  if (named.rest.find_first_not_of(' ') == std::string::npos)
    return unexpected(invalid(flag, text, "must be NAME: COMMAND"));
  return Contestant{named.name, Peer{named.rest}};
}

Attempt attempt(const Contestant& contestant, const OwnedProblem& problem, const std::string& file,
                double time_limit_s, const std::stop_token& stop) {
  if (const Options* options = std::get_if<Options>(&contestant.solver))
    return solve_by(*options, problem, time_limit_s, stop);
  return ask(std::get<Peer>(contestant.solver), problem, file, time_limit_s, stop);
}

}  // namespace marble::cli
