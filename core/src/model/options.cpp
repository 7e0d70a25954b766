#include "marble/options.h"

#include <cmath>
#include <type_traits>

#include "model/text_of.h"

namespace marble {
namespace {

// Defines how an option type is printed, parsed and checked. A new choice adds one specialization with its
// names.
template <class T>
struct OptionTraits;
template <>
struct OptionTraits<double> {
  static constexpr OptionType kind = OptionType::real;
  static constexpr std::span<const std::string_view> choices = {};
};
template <>
struct OptionTraits<int> {
  static constexpr OptionType kind = OptionType::integer;
  static constexpr std::span<const std::string_view> choices = {};
};
template <>
struct OptionTraits<bool> {
  static constexpr OptionType kind = OptionType::boolean;
  static constexpr std::span<const std::string_view> choices = {};
};
template <>
struct OptionTraits<Path> {
  static constexpr OptionType kind = OptionType::choice;
  static constexpr std::string_view names[] = {"fast", "paper", "algorithm1"};
  static constexpr std::span<const std::string_view> choices = names;
};

template <>
struct OptionTraits<Method> {
  static constexpr OptionType kind = OptionType::choice;
  static constexpr std::string_view names[] = {
      "marble", "penalty_scp", "relaxation", "l1_penalty",          "exterior",
      "alag",   "aladin_beta", "l1_barrier", "l1_barrier_stepwise", "plain_barrier"};
  static constexpr std::span<const std::string_view> choices = names;
};
template <>
struct OptionTraits<Retraction> {
  static constexpr OptionType kind = OptionType::choice;
  static constexpr std::string_view names[] = {"softplus", "exponential"};
  static constexpr std::span<const std::string_view> choices = names;
};

template <class T>
constexpr OptionInfo row(std::string_view name, T value, T low, T high, std::string_view unit,
                         std::string_view doc, bool research) {
  return {name,
          OptionTraits<T>::kind,
          static_cast<double>(value),
          static_cast<double>(low),
          static_cast<double>(high),
          unit,
          doc,
          OptionTraits<T>::choices,
          research};
}

constexpr OptionInfo kTable[] = {
#define MARBLE_OPTION(type, name, value, low, high, unit, doc) \
  row<type>(#name, value, low, high, unit, doc, false),
#define MARBLE_RESEARCH_OPTION(type, name, value, low, high, unit, doc) \
  row<type>(#name, value, low, high, unit, doc, true),
#include "marble/options.def"
#undef MARBLE_OPTION
};

Expected<const OptionInfo*> find(std::string_view name) {
  for (const OptionInfo& info : kTable) {
    if (info.name == name) return &info;
  }
  return unexpected(invalid(std::string(name), "is not an option"));
}

std::string join(std::span<const std::string_view> names) {
  std::string text;
  for (const std::string_view name : names) text.append(text.empty() ? "" : ", ").append(name);
  return text;
}

std::string range_of(const OptionInfo& info) {
  if (info.type == OptionType::choice) return "must be one of " + join(info.choices);
  return "must be in [" + text_of(info.low) + ", " + text_of(info.high) + "]";
}

Expected<void> check(const OptionInfo& info, double value) {
  if (!(value >= info.low && value <= info.high)) {  // also catches NaN
    return unexpected(invalid(std::string(info.name), text_of(value), range_of(info)));
  }
  if (info.type != OptionType::real && value != std::floor(value)) {
    return unexpected(invalid(std::string(info.name), text_of(value), "must be a whole number"));
  }
  return {};
}

}  // namespace

std::span<const OptionInfo> option_table() { return kTable; }

Expected<void> set_option(Options& options, std::string_view name, double value) {
  MARBLE_ASSIGN_OR_RETURN(const auto info, find(name));
  MARBLE_RETURN_IF_ERROR(check(*info, value));
#define MARBLE_OPTION(type, member, default_value, low, high, unit, doc) \
  if (name == #member) options.member = static_cast<type>(value);
#include "marble/options.def"
#undef MARBLE_OPTION
  return {};
}

Expected<void> set_option_text(Options& options, std::string_view name, std::string_view text) {
  MARBLE_ASSIGN_OR_RETURN(const auto info, find(name));
  const OptionInfo& option = *info;
  if (option.type == OptionType::choice) {
    for (std::size_t i = 0; i < option.choices.size(); ++i) {
      if (option.choices[i] == text) return set_option(options, name, static_cast<double>(i));
    }
    return unexpected(invalid(std::string(name), std::string(text), range_of(option)));
  }
  if (option.type == OptionType::boolean) {
    if (text == "true" || text == "1") return set_option(options, name, 1.0);
    if (text == "false" || text == "0") return set_option(options, name, 0.0);
    return unexpected(invalid(std::string(name), std::string(text), "must be true or false"));
  }
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc::invalid_argument || end != text.data() + text.size()) {
    return unexpected(invalid(std::string(name), std::string(text), "must be a number"));
  }
  if (error == std::errc::result_out_of_range) {  // too large or too small for a double
    return unexpected(invalid(std::string(name), std::string(text), range_of(option)));
  }
  return set_option(options, name, value);
}

double get_option(const Options& options, std::string_view name) {
#define MARBLE_OPTION(type, member, default_value, low, high, unit, doc) \
  if (name == #member) return static_cast<double>(options.member);
#include "marble/options.def"
#undef MARBLE_OPTION
  return std::nan("");
}

Expected<void> validate(const Options& options) {
  if (auto valid = validate_ranges(options); !valid || options.method == Method::marble) return valid;
  return unexpected(
      invalid("method", std::string(OptionTraits<Method>::names[static_cast<std::size_t>(options.method)]),
              "must be marble; `marble compare` and `marble reproduce` run the others"));
}

Expected<void> validate_ranges(const Options& options) {
  const OptionInfo* info = kTable;
#define MARBLE_OPTION(type, member, default_value, low, high, unit, doc) \
  MARBLE_RETURN_IF_ERROR(check(*info++, static_cast<double>(options.member)));
#include "marble/options.def"
#undef MARBLE_OPTION
  return {};
}

Expected<void> validate_without_explain(const Options& options) {
  if (options.explain)
    return unexpected(invalid("explain", "true", "must be false in sessions, coupled and scenario solves"));
  return validate(options);
}

}  // namespace marble
