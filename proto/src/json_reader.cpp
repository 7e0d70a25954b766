#include "json_reader.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "marble/contract.h"

namespace marble::json {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMostShown = 200;  // characters of the file in one message

constexpr std::pair<std::string_view, JsonVector JsonParts::*> kVectors[] = {
    {"x0", &JsonParts::x0},
#define MARBLE_VECTOR(letter, field) {#letter, &JsonParts::letter},
#include "marble/contract.def"
};
constexpr std::pair<std::string_view, JsonMatrix JsonParts::*> kMatrices[] = {
#define MARBLE_MATRIX(letter, field, update, vector) {#letter, &JsonParts::letter},
#include "marble/contract.def"
};
constexpr std::string_view kScalars[] = {"n", "c0", "name", "best_known_objective"};
constexpr std::string_view kMembers[] = {"rows", "cols", "i", "j", "v"};

constexpr const char* kFinite = "must be a finite number";
constexpr const char* kIndex = "must be a whole number in [0, 2^31)";
constexpr const char* kSize = "must be a whole number in [0, 2^28)";
constexpr const char* kVariables = "must be a whole number in [1, 2^28)";

template <class Table, class Key>
auto member_of(JsonParts& parts, const Table& table, const Key& key) -> decltype(&(parts.*table[0].second)) {
  for (const auto& [name, member] : table) {
    if (name == key) return &(parts.*member);
  }
  return nullptr;
}

template <class Names>
bool contains(const Names& names, const std::string& name) {
  return std::find(std::begin(names), std::end(names), name) != std::end(names);
}

// For a terminal: one line of ASCII for any contents of the file.
std::string shown(std::string text) {
  if (text.size() > kMostShown) text = text.substr(0, kMostShown) + "...";
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

std::string text_of(double value) { return Json(value).dump(); }

// Returns the word of `text` that ends at or after `position`: the unexpected text, as a user would name it.
std::string_view word_at(std::string_view text, std::size_t position) {
  constexpr std::string_view kDelimiters = " \t\r\n,:[]{}\"";
  const std::size_t at = std::min(position == 0 ? 0 : position - 1, text.size());
  const std::size_t before = text.substr(0, at).find_last_of(kDelimiters);
  const std::size_t begin = before == std::string_view::npos ? 0 : before + 1;
  return text.substr(begin, std::min(text.find_first_of(kDelimiters, at), text.size()) - begin);
}

bool is_nan_or_infinity(std::string_view word) {
  if (!word.empty() && (word[0] == '-' || word[0] == '+')) word.remove_prefix(1);
  const auto is = [word](std::string_view name) {
    return std::equal(word.begin(), word.end(), name.begin(), name.end(),
                      [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; });
  };
  return is("nan") || is("inf") || is("infinity");
}

// The exception contains line, column and what was expected there.
std::string not_json(const Json::exception& exception) {
  std::string what = exception.what();
  if (const std::size_t start = what.find("] "); start != std::string::npos) what.erase(0, start + 2);
  return "is not JSON: " + shown(what);
}

// Receives nlohmann's events. The state is the position: the key of the problem, in a matrix the key of the
// matrix, in an array the index, or somewhere inside an ignored value.
class Reader {
 public:
  explicit Reader(std::string_view text) : text_(text) {}

  JsonParts parts;
  std::optional<Error> error;

  // NOLINTBEGIN(readability-identifier-naming): the names nlohmann calls
  bool null() {
    if (ignored_ > 0 || is_ignored_value()) return true;
    if (place_ == Place::problem && key_ != "n" && key_ != "g") return true;
    return wrong("null");
  }
  bool boolean(bool value) { return other(value ? "true" : "false"); }
  bool string(std::string& value) {
    if (ignored_ == 0 && place_ == Place::problem && key_ == "name") {
      parts.name = value;
      return true;
    }
    return other("\"" + shown(value) + "\"");
  }
  bool binary(Json::binary_t&) { return other("binary"); }
  bool number_integer(std::int64_t value) { return number(static_cast<double>(value), value); }
  bool number_unsigned(std::uint64_t value) {
    const bool fits = value <= static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    return fits ? number(static_cast<double>(value), static_cast<std::int64_t>(value))
                : number(static_cast<double>(value), std::nullopt);
  }
  bool number_float(double value, const std::string&) { return number(value, std::nullopt); }

  bool start_object(std::size_t) {
    if (ignored_ > 0 || is_ignored_value()) return ++ignored_, true;
    if (place_ == Place::outside) return place_ = Place::problem, true;
    if (place_ == Place::problem && matrix_ != nullptr) {
      matrix_->present = true;
      member_.clear();
      members_.clear();
      return place_ = Place::matrix, true;
    }
    return wrong("an object");
  }
  bool key(std::string& name) {
    if (ignored_ > 0) return true;
    auto& known = place_ == Place::matrix ? members_ : keys_;
    (place_ == Place::matrix ? member_ : key_) = name;
    if (place_ == Place::problem) {
      vector_ = member_of(parts, kVectors, name);
      matrix_ = member_of(parts, kMatrices, name);
    }
    if (is_ignored_value() || known.insert(name).second) return true;
    error = invalid(field(), "is there twice");
    return false;
  }
  bool end_object() {
    if (ignored_ > 0) return --ignored_, true;
    place_ = place_ == Place::matrix ? Place::problem : Place::outside;
    return true;
  }
  bool start_array(std::size_t) {
    if (ignored_ > 0 || is_ignored_value()) return ++ignored_, true;
    if (place_ == Place::problem && vector_ != nullptr) {
      index_ = 0;
      vector_->present = true;
      return place_ = Place::vector, true;
    }
    if (place_ == Place::matrix && member_ == "i") return matrix_->has_i = true, enter(matrix_->entries.rows);
    if (place_ == Place::matrix && member_ == "j")
      return matrix_->has_j = true, enter(matrix_->entries.columns);
    if (place_ == Place::matrix && member_ == "v") {
      matrix_->has_v = true;
      index_ = 0;
      return place_ = Place::values, true;
    }
    return wrong("an array");
  }
  bool end_array() {
    if (ignored_ > 0) return --ignored_, true;
    place_ = place_ == Place::vector ? Place::problem : Place::matrix;
    return true;
  }
  bool parse_error(std::size_t position, const std::string& token, const Json::exception& exception) {
    const std::string_view word = word_at(text_, position);
    if (exception.id == 406) return wrong(shown(token));  // a number that no double can represent: 1e999
    if (is_nan_or_infinity(word)) return wrong(shown(std::string(word)));
    error = invalid(field(), in_array() ? index_ : -1, "", not_json(exception));
    return false;
  }
  // NOLINTEND

 private:
  enum class Place { outside, problem, vector, matrix, indices, values };

  [[nodiscard]] bool in_array() const {
    return place_ == Place::vector || place_ == Place::indices || place_ == Place::values;
  }

  // True if the next value belongs to an unknown key.
  [[nodiscard]] bool is_ignored_value() const {
    if (place_ == Place::matrix) return !contains(kMembers, member_);
    if (place_ != Place::problem) return false;
    return vector_ == nullptr && matrix_ == nullptr && !contains(kScalars, key_);
  }

  [[nodiscard]] std::string field() const {
    const bool inside = place_ == Place::matrix || place_ == Place::indices || place_ == Place::values;
    return inside && !member_.empty() ? key_ + "." + member_ : shown(key_);
  }

  [[nodiscard]] const char* rule() const {
    switch (place_) {
      case Place::outside:
        return "a problem must be a JSON object";
      case Place::vector:
      case Place::values:
        return kFinite;
      case Place::indices:
        return kIndex;
      case Place::matrix:
        return member_ == "rows" || member_ == "cols" ? kSize : "must be an array";
      case Place::problem:
        break;
    }
    if (matrix_ != nullptr) return "must be an object {rows, cols, i, j, v}";
    if (vector_ != nullptr) return "must be an array";
    if (key_ == "name") return "must be a string";
    return key_ == "n" ? kVariables : kFinite;
  }

  bool wrong(std::string value) {
    error = invalid(field(), in_array() ? index_ : -1, std::move(value), rule());
    return false;
  }
  bool other(std::string value) {
    return ignored_ > 0 || is_ignored_value() ? true : wrong(std::move(value));
  }

  bool enter(std::vector<Index>& indices) {
    indices_ = &indices;
    index_ = 0;
    return place_ = Place::indices, true;
  }

  bool number(double value, std::optional<std::int64_t> whole) {
    if (ignored_ > 0) return true;
    const auto shown_value = [&] { return whole ? std::to_string(*whole) : text_of(value); };
    switch (place_) {
      case Place::vector:
        vector_->values.push_back(value);
        return ++index_, true;
      case Place::values:
        matrix_->entries.values.push_back(value);
        return ++index_, true;
      case Place::indices:
        // Negative ones pass: the code that knows the number of rows reports the valid range.
        if (!whole || *whole < std::numeric_limits<Index>::min() ||
            *whole > std::numeric_limits<Index>::max())
          return wrong(shown_value());
        indices_->push_back(static_cast<Index>(*whole));
        return ++index_, true;
      case Place::matrix:
        if (is_ignored_value()) return true;
        if (member_ != "rows" && member_ != "cols") return wrong(shown_value());
        return size(member_ == "rows" ? matrix_->rows : matrix_->columns, whole, shown_value());
      case Place::problem:
        if (is_ignored_value()) return true;
        if (key_ == "n") return size(parts.n, whole == 0 ? std::nullopt : whole, shown_value());
        if (key_ == "c0") return parts.c0 = value, true;
        if (key_ == "best_known_objective") return parts.best_known_objective = value, true;
        return wrong(shown_value());
      case Place::outside:
        return wrong(shown_value());
    }
    return false;
  }

  bool size(std::optional<Index>& into, std::optional<std::int64_t> whole, std::string value) {
    if (!whole || *whole < 0 || *whole > contract::most_rows) return wrong(std::move(value));
    into = static_cast<Index>(*whole);
    return true;
  }

  std::string_view text_;
  Place place_ = Place::outside;
  std::string key_, member_;
  std::set<std::string> keys_, members_;
  JsonVector* vector_ = nullptr;
  JsonMatrix* matrix_ = nullptr;
  std::vector<Index>* indices_ = nullptr;
  std::int64_t index_ = 0;
  std::size_t ignored_ = 0;  // open containers inside an ignored value
};

// The same for a request: the events of its problem go to the problem's reader, all others are written out
// again.
class RequestReader {
 public:
  RequestReader(std::string_view text, std::span<const std::string_view> members)
      : problem_(text), members_(members) {}

  [[nodiscard]] Expected<JsonRequestParts> result() && {
    if (error_) return unexpected(std::move(*error_));
    if (problem_.error) {
      Error& error = *problem_.error;
      if (!bare_) error = error.field.empty() ? of_field("problem", error) : inside("problem", error);
      return unexpected(std::move(error));
    }
    JsonRequestParts parts{std::nullopt, bare_, std::move(rest_)};
    if (bare_ || keys_.contains("problem")) parts.problem = std::move(problem_.parts);
    return parts;
  }

  // NOLINTBEGIN(readability-identifier-naming): the names nlohmann calls
  bool null() {
    return scalar("null", [&] { return problem_.null(); });
  }
  bool boolean(bool value) {
    return scalar(value ? "true" : "false", [&] { return problem_.boolean(value); });
  }
  bool string(std::string& value) {
    return scalar(Json(value).dump(), [&] { return problem_.string(value); });
  }
  bool binary(Json::binary_t&) { return false; }  // JSON has none
  bool number_integer(std::int64_t value) {
    return scalar(std::to_string(value), [&] { return problem_.number_integer(value); });
  }
  bool number_unsigned(std::uint64_t value) {
    return scalar(std::to_string(value), [&] { return problem_.number_unsigned(value); });
  }
  bool number_float(double value, const std::string& text) {
    return scalar(text, [&] { return problem_.number_float(value, text); });
  }
  bool start_object(std::size_t size) {
    if (depth_++ == 0) return true;  // its first key determines its type
    return open("{", [&] { return problem_.start_object(size); });
  }
  bool start_array(std::size_t size) {
    if (depth_++ == 0) return not_an_object();
    return open("[", [&] { return problem_.start_array(size); });
  }
  bool end_object() {
    if (--depth_ > 0) return close("}", [&] { return problem_.end_object(); });
    if (keys_.empty()) bare_ = problem_.start_object(0);
    rest_ += '}';
    return !bare_ || problem_.end_object();
  }
  bool end_array() {
    --depth_;
    return close("]", [&] { return problem_.end_array(); });
  }
  bool key(std::string& name) {
    if (depth_ > 1) return in_problem_ ? problem_.key(name) : write(Json(name).dump() + ":");
    const bool member = name == "problem" || contains(members_, name);
    if (keys_.empty() && !member) bare_ = in_problem_ = problem_.start_object(0);
    const std::string shown_name = shown(name);
    if (bare_ && member) return wrong(shown_name, "stands beside a problem, which is then in \"problem\"");
    if (!bare_ && !member)
      return wrong(shown_name, "is no member of a request; a problem's are in \"problem\"");
    if (bare_) {
      keys_.insert("");
      return problem_.key(name);
    }
    if (!keys_.insert(name).second) return wrong(shown_name, "is there twice");
    in_problem_ = name == "problem";
    return in_problem_ || write(Json(name).dump() + ":");
  }
  bool parse_error(std::size_t position, const std::string& token, const Json::exception& exception) {
    if (in_problem_) return problem_.parse_error(position, token, exception);
    return wrong("", not_json(exception));
  }
  // NOLINTEND

 private:
  bool wrong(std::string field, std::string rule) {
    error_ = invalid(std::move(field), -1, "", std::move(rule));
    return false;
  }
  bool not_an_object() { return wrong("", "a request must be a JSON object"); }
  bool write(const std::string& text) {
    if (const char last = rest_.back(); last != '{' && last != '[' && last != ':') rest_ += ',';
    rest_ += text;
    return true;
  }
  template <class Forward>
  bool open(const char* text, const Forward& forward) {
    return in_problem_ ? forward() : write(text);
  }
  template <class Forward>
  bool close(const char* text, const Forward& forward) {
    if (in_problem_) return forward();
    rest_ += text;
    return true;
  }
  template <class Forward>
  bool scalar(const std::string& text, const Forward& forward) {
    if (depth_ == 0) return not_an_object();
    return in_problem_ ? forward() : write(text);
  }

  Reader problem_;
  const std::span<const std::string_view> members_;
  std::optional<Error> error_;
  std::set<std::string> keys_;
  std::string rest_ = "{";
  std::size_t depth_ = 0;
  bool bare_ = false, in_problem_ = false;
};

constexpr std::string_view kSpace = " \t\r\n";

}  // namespace

Expected<JsonParts> read_json_parts(std::string_view text) {
  if (text.find_first_not_of(kSpace) == std::string_view::npos) {
    return unexpected(failure(ErrorCode::invalid_argument, "is empty"));
  }
  Reader reader(text);
  const bool complete = Json::sax_parse(text.begin(), text.end(), &reader);
  if (reader.error) return unexpected(*reader.error);
  if (!complete) return unexpected(failure(ErrorCode::invalid_argument, "is not JSON"));
  return std::move(reader.parts);
}

Expected<JsonRequestParts> read_json_request(std::string_view text,
                                             std::span<const std::string_view> members) {
  if (text.find_first_not_of(kSpace) == std::string_view::npos) {
    return unexpected(failure(ErrorCode::invalid_argument, "is empty"));
  }
  RequestReader reader(text, members);
  static_cast<void>(Json::sax_parse(text.begin(), text.end(), &reader));  // the reader records any error
  return std::move(reader).result();
}

}  // namespace marble::json
