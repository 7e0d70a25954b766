#include "nl/nl_tokens.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <numeric>

namespace marble::formats {
namespace {

constexpr std::string_view kBlank = " \t\r";
constexpr int kMostEntries = 0x7fffffff;

std::string_view without_comment(std::string_view line) {
  line = line.substr(0, line.find('#'));
  const std::size_t last = line.find_last_not_of(kBlank);
  return last == std::string_view::npos ? std::string_view() : line.substr(0, last + 1);
}

// Removes the first word from a line and returns it.
std::string_view take_word(std::string_view& line) {
  const std::size_t begin = line.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return line = {};
  const std::size_t end = std::min(line.find_first_of(" \t\r\n", begin), line.size());
  const std::string_view word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return word;
}

}  // namespace

void NlTokens::fail(const std::string& field, const std::string& value, const std::string& bound) {
  if (failed_) return;
  failed_ = true;
  const std::string where = binary_ ? "" : " in line " + std::to_string(line_);
  error_ = invalid(field, value, bound + where);
}

std::string_view NlTokens::line() {
  ++line_;
  const std::size_t end = std::min(rest_.find('\n'), rest_.size());
  const std::string_view line = rest_.substr(0, end);
  rest_.remove_prefix(std::min(end + 1, rest_.size()));
  return line;
}

std::array<int, 6> NlTokens::header_line(int number, int least) {
  std::array<int, 6> values = {};
  std::string_view words = without_comment(line());
  int count = 0;
  while (count < 6) {
    const std::string_view word = take_word(words);
    if (word.empty()) break;
    int value = 0;
    const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (code != std::errc() || value < 0) break;
    values[count++] = value;
  }
  if (count < least) fail("header", "line " + std::to_string(number), "must hold counts >= 0");
  return values;
}

// Reads "3 1 1 0": the count and the values; a non-number ends them, as in older files.
void NlTokens::options_line(std::string_view words, NlHeader& header) {
  constexpr int kMostOptions = 9;
  constexpr int kHasTolerance = 3;
  words = without_comment(words);
  const auto next = [&words](auto& value) {
    const std::string_view word = take_word(words);
    return std::from_chars(word.data(), word.data() + word.size(), value).ec == std::errc();
  };
  int count = 0, value = 0;
  if (!next(count) || count > kMostOptions) return;
  while (static_cast<int>(header.options.size()) < count && next(value)) header.options.push_back(value);
  double tolerance = 0.0;
  if (count > 1 && header.options.size() > 1 && header.options[1] == kHasTolerance && next(tolerance))
    header.vb_tolerance = tolerance;
}

NlHeader NlTokens::header() {
  NlHeader header;
  const std::string_view first = line();
  if (first.empty() || (first[0] != 'g' && first[0] != 'b')) {
    fail("header", std::string(first.substr(0, 1)), "must start with g or b: not an .nl file");
    return header;
  }
  header.binary = first[0] == 'b';
  options_line(first.substr(1), header);
  const auto sizes = header_line(2, 3);
  header.variables = sizes[0];
  header.constraints = sizes[1];
  header.objectives = sizes[2];
  header.logical_constraints = sizes[5];
  static_cast<void>(header_line(3, 2));
  const auto networks = header_line(4, 2);
  header.networks = std::int64_t{networks[0]} + networks[1];
  const auto nonlinear = header_line(5, 2);
  const auto flags = header_line(6, 2);
  header.functions = flags[1];
  if (header.binary && flags[2] > 1)
    fail("header", "arithmetic " + std::to_string(flags[2]), "must be IEEE, little-endian");
  const auto discrete = header_line(7, 2);
  header.integers = std::accumulate(discrete.begin(), discrete.begin() + 5, std::int64_t{0});
  // Integers are last in each group: of variables in constraints and objective, in constraints, in the
  // objective, and of all (Gay, table 3).
  header.first_integer = std::int64_t{header.variables} - discrete[0] - discrete[1];
  const int last[] = {nonlinear[2], nonlinear[0], std::max(nonlinear[0], nonlinear[1])};
  for (int kind = 0; kind < 3; ++kind) {
    if (discrete[2 + kind] > 0) header.first_integer = std::int64_t{last[kind]} - discrete[2 + kind];
  }
  const auto nonzeros = header_line(8, 2);
  header.jacobian = nonzeros[0];
  header.gradient = nonzeros[1];
  for (int number = 9; number <= 10; ++number) static_cast<void>(header_line(number, 1));
  binary_ = header.binary;
  return header;
}

template <class Number>
Number NlTokens::raw() {
  Number value = 0;
  if (rest_.size() < sizeof value) {
    fail("file", "", "ends too soon");
    return 0;
  }
  std::memcpy(&value, rest_.data(), sizeof value);
  rest_.remove_prefix(sizeof value);
  return value;
}

char NlTokens::key() {
  if (failed_) return '\0';
  if (binary_) return rest_.empty() ? '\0' : raw<char>();
  while (!rest_.empty()) {
    const char c = rest_.front();
    if (c == '#') {
      static_cast<void>(line());
      continue;
    }
    if (c == '\n') ++line_;
    rest_.remove_prefix(1);
    if (c != '\n' && kBlank.find(c) == std::string_view::npos) return c;
  }
  return '\0';
}

std::string_view NlTokens::word() {
  while (!rest_.empty()) {
    const char c = rest_.front();
    if (c == '#') {
      static_cast<void>(line());
    } else if (c == '\n' || kBlank.find(c) != std::string_view::npos) {
      if (c == '\n') ++line_;
      rest_.remove_prefix(1);
    } else {
      return take_word(rest_);
    }
  }
  fail("file", "", "ends too soon");
  return {};
}

int NlTokens::integer(const char* what, int low, int high) {
  if (failed_) return low;
  int value = 0;
  if (binary_) {
    value = raw<std::int32_t>();
  } else {
    const std::string_view text = word();
    const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (code != std::errc() || end != text.data() + text.size()) {
      fail(what, std::string(text), "must be an integer");
      return low;
    }
  }
  if (value >= low && value <= high) return value;
  const std::string range = high == kMostEntries
                                ? ">= " + std::to_string(low)
                                : "in [" + std::to_string(low) + ", " + std::to_string(high) + "]";
  fail(what, std::to_string(value), "must be " + range);
  return low;
}

double NlTokens::real(const char* what) {
  if (failed_) return 0.0;
  if (binary_) return raw<double>();
  const std::string_view text = word();
  double value = 0.0;
  const std::string_view digits = !text.empty() && text[0] == '+' ? text.substr(1) : text;
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (code == std::errc() && end == digits.data() + digits.size()) return value;
  fail(what, std::string(text), "must be a number");
  return 0.0;
}

double NlTokens::short_constant(char key) {
  if (failed_) return 0.0;
  if (!binary_) return real("constant");
  return key == 's' ? raw<std::int16_t>() : raw<std::int32_t>();
}

void NlTokens::skip_name() {
  if (failed_) return;
  if (!binary_) {
    static_cast<void>(word());
    return;
  }
  const int length = integer("length of a name", 0, kMostEntries);
  if (static_cast<std::size_t>(length) > rest_.size()) return fail("file", "", "ends too soon");
  rest_.remove_prefix(static_cast<std::size_t>(length));
}

}  // namespace marble::formats
