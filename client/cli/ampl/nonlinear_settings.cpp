#include "ampl/nonlinear_settings.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <utility>

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
    const auto method = nonlinear::method_of(value);
    if (!method) return unexpected(method.error());
    return settings.method = *method, Expected<void>{};
  }
  if (name == "curvature") {
    for (const auto& [word, curvature] : kCurvatures) {
      if (value == word) return settings.curvature = curvature, Expected<void>{};
    }
    return unexpected(invalid(name, value, "must be exact, bfgs or none"));
  }
  if (auto set = set_option_text(settings.lcqp, name, value); !set) return set;
  if (name == "time_limit_s") {
    const double all = std::exchange(settings.lcqp.time_limit_s, Options().time_limit_s);
    settings.time_limit_s = std::max(all, std::numeric_limits<double>::min());
  }
  return {};
}

}  // namespace marble::cli
