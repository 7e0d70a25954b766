// How long_request() is solved, on the command line.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "marble/options.h"
#include "problems.h"

namespace marble::testing {

inline std::string option_flag(const v1::SolveOptions& options, const OptionInfo& option) {
  const auto* field = options.GetDescriptor()->FindFieldByName(std::string(option.name));
  const auto* reflection = options.GetReflection();
  if (!reflection->HasField(options, field)) return "";
  std::string value;
  switch (option.type) {
    case OptionType::real:
      value = nlohmann::json(reflection->GetDouble(options, field)).dump();
      break;
    case OptionType::integer:
      value = std::to_string(reflection->GetInt32(options, field));
      break;
    case OptionType::boolean:
      value = reflection->GetBool(options, field) ? "true" : "false";
      break;
    case OptionType::choice:
      value = option.choices[static_cast<std::size_t>(reflection->GetEnumValue(options, field) - 1)];
      break;
  }
  return " --option " + std::string(option.name) + "=" + value;
}

/// " --option name=value" for each that is set, to go with a file of the problem.
inline std::string long_options() {
  const v1::SolveRequest request = long_request();
  std::string flags;
  for (const OptionInfo& option : option_table()) flags += option_flag(request.options(), option);
  return flags;
}

}  // namespace marble::testing
