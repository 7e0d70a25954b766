#include "arguments/solver_arguments.h"

#include <algorithm>

#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/suggestion.h"
#include "marble/report/option_scope.h"

namespace marble::cli {
void add_solver_arguments(CLI::App& command, SolverArguments& arguments) {
  command
      .add_option("--option", arguments.options,
                  "a solver option, name=value; may be repeated (see: marble options)")
      ->allow_extra_args(false);
  command.add_option("--time-limit", arguments.time_limit_s,
                     "seconds for each solve; the best iterate is returned");
}

Expected<Options> parse_options(const SolverArguments& arguments) {
  MARBLE_ASSIGN_OR_RETURN(auto options, parse_research_options(arguments));
  MARBLE_RETURN_IF_ERROR(validate(options));
  return options;
}

Expected<Options> parse_research_options(const SolverArguments& arguments) {
  Options options;
  for (const std::string& option : arguments.options) {
    const std::size_t equals = option.find('=');
    if (equals == std::string::npos) {
      return unexpected(invalid("--option", option, "must be name=value"));
    }
    MARBLE_RETURN_IF_ERROR(set_option_text(options, option.substr(0, equals), option.substr(equals + 1)));
  }
  if (!arguments.time_limit_s.empty()) {
    auto set = set_option_text(options, "time_limit_s", arguments.time_limit_s);
    if (!set) return unexpected(of_field("--time-limit", set.error()));
  }
  return options;
}

void warn_of_idle_options(const SolverArguments& arguments, const Options& options) {
  for (const std::string& option : arguments.options) {
    const std::string name = option.substr(0, option.find('='));
    if (!option_counts(options, name))
      complain("warning: option " + name + " counts only with " + std::string(option_scope(name)));
  }
}

int option_fails(const Error& error) {
  std::vector<std::string> names;
  for (const OptionInfo& option : option_table()) names.emplace_back(option.name);
  const bool unknown =
      error.field.find('-') == std::string::npos && std::ranges::find(names, error.field) == names.end();
  complain(error.message() + (unknown ? did_you_mean(error.field, names) : "") +
           "  (marble options lists them all)");
  return kBadInput;
}

}  // namespace marble::cli
