#include "nl/sol_file.h"

#include <charconv>
#include <sstream>

namespace marble::formats {
namespace {

constexpr int kReal = 4;  // a suffix's values are real: added to its kind

void add_line(std::string& text, double value) {
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  text.append(digits, end).push_back('\n');
}

void add_line(std::string& text, std::int64_t value) { text += std::to_string(value) + "\n"; }

void add_message(std::string& text, const std::string& message) {
  std::istringstream lines(message);
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) text += line + "\n";
  }
  text += "\n";
}

void add_suffix(std::string& text, const SolSuffix& suffix) {
  text += "suffix " + std::to_string(static_cast<int>(suffix.of) + kReal) + " " +
          std::to_string(suffix.values.size()) + " " + std::to_string(suffix.name.size() + 1) + " 0 0\n" +
          suffix.name + "\n";
  for (const auto& [index, value] : suffix.values) {
    text += std::to_string(index) + " ";
    add_line(text, value);
  }
}

}  // namespace

std::string sol_text(const SolFile& sol) {
  std::string text;
  add_message(text, sol.message);
  const auto options = static_cast<std::int64_t>(sol.options.size());
  text += "Options\n";
  add_line(text, options + (sol.vb_tolerance ? 2 : 0));  // announces the tolerance to readers
  for (const int option : sol.options) add_line(text, std::int64_t{option});
  add_line(text, std::int64_t{sol.constraints});
  add_line(text, static_cast<std::int64_t>(sol.duals.size()));
  add_line(text, std::int64_t{sol.variables});
  add_line(text, static_cast<std::int64_t>(sol.primals.size()));
  if (sol.vb_tolerance) add_line(text, *sol.vb_tolerance);
  for (const double value : sol.duals) add_line(text, value);
  for (const double value : sol.primals) add_line(text, value);
  if (!sol.code) return text;
  text += "objno 0 " + std::to_string(*sol.code) + "\n";
  for (const SolSuffix& suffix : sol.suffixes) add_suffix(text, suffix);
  return text;
}

}  // namespace marble::formats
