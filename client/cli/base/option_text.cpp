#include "base/option_text.h"

#include <nlohmann/json.hpp>

namespace marble::cli {

std::string option_text(const OptionInfo& option, double value) {
  switch (option.type) {
    case OptionType::choice:
      return std::string(option.choices[static_cast<std::size_t>(value)]);
    case OptionType::boolean:
      return value != 0.0 ? "true" : "false";
    case OptionType::integer:
      return std::to_string(static_cast<std::int64_t>(value));
    case OptionType::real:
      break;
  }
  return nlohmann::json(value).dump();
}

}  // namespace marble::cli
