#include "marble/report/option_scope.h"

#include <algorithm>

namespace marble {
namespace {

// Passes the parts of a text to `part` one by one, as long as it returns true.
template <class Part>
bool all_parts(std::string_view text, std::string_view separator, const Part& part) {
  while (true) {
    const std::size_t end = text.find(separator);
    if (!part(text.substr(0, end))) return false;
    if (end == std::string_view::npos) return true;
    text.remove_prefix(end + separator.size());
  }
}

// True if a text is a scope; `holds` is called with every name and its values, "fast or paper".
template <class Holds>
bool reads(std::string_view text, const Holds& holds) {
  return all_parts(text, ", ", [&](std::string_view condition) {
    constexpr std::string_view kIs = " = ";
    const std::size_t is = condition.find(kIs);
    return is != std::string_view::npos && holds(condition.substr(0, is), condition.substr(is + kIs.size()));
  });
}

bool has_value(const Options& options, std::string_view name, std::string_view values) {
  const double now = get_option(options, name);
  return !all_parts(values, " or ", [&](std::string_view value) {
    Options other;
    return !set_option_text(other, name, value) || get_option(other, name) != now;
  });
}

bool are_values(std::string_view name, std::string_view values) {
  return all_parts(values, " or ", [name](std::string_view value) {
    Options other;
    return set_option_text(other, name, value).has_value();
  });
}

}  // namespace

std::string_view option_scope(std::string_view name) {
  const auto info = std::ranges::find(option_table(), name, &OptionInfo::name);
  if (info == option_table().end()) return {};
  const std::size_t end = info->doc.find(": ");
  if (end == std::string_view::npos) return {};
  const std::string_view scope = info->doc.substr(0, end);
  return reads(scope, are_values) ? scope : std::string_view();
}

bool option_counts(const Options& options, std::string_view name) {
  const std::string_view scope = option_scope(name);
  return scope.empty() || reads(scope, [&options](std::string_view other, std::string_view values) {
           return has_value(options, other, values);
         });
}

}  // namespace marble
