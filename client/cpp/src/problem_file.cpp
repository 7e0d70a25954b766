#include "marble/problem_file.h"

#include <cmath>
#include <fstream>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "marble/convert.h"

namespace marble {
namespace {

using Json = nlohmann::json;

Error fault(std::string field, std::int64_t index, std::string value, std::string bound) {
  return {ErrorCode::invalid_argument, std::move(field), index, std::move(value), std::move(bound)};
}

std::string brief(const Json& value) {
  std::string text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
  return text.size() <= 40 ? text : text.substr(0, 37) + "...";
}

// Reads the parts of one problem; after the first error every further step does nothing.
class JsonReader {
 public:
  explicit JsonReader(const Json& json) : json_(json) {}

  double number(const char* key, double otherwise) {
    const Json* value = find(key);
    if (value == nullptr) return otherwise;
    if (!value->is_number()) return fail(key, -1, brief(*value), "must be a number"), otherwise;
    return value->get<double>();
  }

  std::vector<double> vector(const char* key, std::optional<std::size_t> size = std::nullopt) {
    std::vector<double> result;
    const Json* value = find(key);
    if (value == nullptr || value->is_null()) return result;
    read_array(*value, key, result, "must be a finite number",
               [](const Json& entry) { return entry.is_number(); });
    if (size && !error_ && result.size() != *size) {
      fail(key, -1, std::to_string(result.size()) + " entries",
           "must have " + std::to_string(*size) + " entries");
    }
    return result;
  }

  SparseMatrix matrix(const char* key, std::size_t n) {
    SparseMatrix none;
    const Json* value = find(key);
    if (value == nullptr || value->is_null()) return none;
    if (!value->is_object())
      return fail(key, -1, brief(*value), "must be an object {rows, cols, i, j, v}"), none;
    const std::string name = key;
    const Index rows = size(*value, name, "rows");
    const Index columns = size(*value, name, "cols");
    // Before anything of that size is allocated.
    if (!error_ && static_cast<std::size_t>(columns) != n) {
      fail(name + ".cols", -1, std::to_string(columns), "must be " + std::to_string(n) + " (n)");
    }
    Triplets entries;
    indices(*value, name, "i", entries.rows);
    indices(*value, name, "j", entries.columns);
    if (const Json* v = member(*value, name, "v")) {
      read_array(*v, name + ".v", entries.values, "must be a finite number",
                 [](const Json& e) { return e.is_number(); });
    }
    if (error_) return none;
    auto compressed = compress(rows, columns, entries, key);
    if (!compressed) {
      error_ = compressed.error();
      return none;
    }
    return std::move(*compressed);
  }

  std::string text(const char* key, const std::string& otherwise) const {
    const auto found = json_.find(key);
    return found != json_.end() && found->is_string() ? found->get<std::string>() : otherwise;
  }

  void fail(std::string field, std::int64_t index, std::string value, std::string bound) {
    if (!error_) error_ = fault(std::move(field), index, std::move(value), std::move(bound));
  }
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }
  [[nodiscard]] bool has(const char* key) const { return json_.contains(key) && !json_.at(key).is_null(); }

 private:
  const Json* find(const char* key) const {
    const auto found = json_.find(key);
    return error_ || found == json_.end() ? nullptr : &*found;
  }
  const Json* member(const Json& object, const std::string& name, const char* key) {
    const auto found = object.find(key);
    if (found == object.end()) return fail(name + "." + key, -1, "", "is missing"), nullptr;
    return error_ ? nullptr : &*found;
  }
  Index size(const Json& object, const std::string& name, const char* key) {
    const Json* value = member(object, name, key);
    if (value == nullptr) return 0;
    if (!value->is_number_integer() || *value < 0 || *value > std::numeric_limits<Index>::max() / 8) {
      return fail(name + "." + key, -1, brief(*value), "must be a whole number in [0, 2^28)"), 0;
    }
    return value->get<Index>();
  }
  void indices(const Json& object, const std::string& name, const char* key, std::vector<Index>& into) {
    const Json* value = member(object, name, key);
    if (value == nullptr) return;
    read_array(*value, name + "." + key, into, "must be a whole number in [-2^31, 2^31)",
               [](const Json& entry) {
                 return entry.is_number_integer() && entry >= std::numeric_limits<Index>::min() &&
                        entry <= std::numeric_limits<Index>::max();
               });
  }
  template <class Value, class Good>
  void read_array(const Json& array, const std::string& field, std::vector<Value>& into, const char* rule,
                  Good&& good) {
    if (!array.is_array()) return fail(field, -1, brief(array), "must be an array");
    into.reserve(array.size());
    for (std::size_t k = 0; k < array.size(); ++k) {
      if (!good(array[k])) return fail(field, static_cast<std::int64_t>(k), brief(array[k]), rule);
      into.push_back(array[k].get<Value>());
    }
  }

  const Json& json_;
  std::optional<Error> error_;
};

// The checks of Problem::create in the words of the file: CSC positions mean nothing to its reader.
Expected<void> check(const OwnedProblem& problem) {
  const auto valid = Problem::create(problem.view());
  if (valid) return {};
  Error error = valid.error();
  if (error.field == "Q.values" && error.bound.rfind("Q must be symmetric", 0) == 0) {
    error.field = "Q";
    error.index = -1;
  }
  return unexpected(std::move(error));
}

Expected<ProblemFile> parse_json(std::string_view content, const std::string& name) {
  Json json;
  try {
    json = Json::parse(content.begin(), content.end());
  } catch (const Json::exception& error) {
    // Its message tells line, column and what was expected there.
    std::string what = error.what();
    if (const std::size_t start = what.find("] "); start != std::string::npos) what.erase(0, start + 2);
    if (what.size() > 200) what.resize(200);
    return unexpected(fault("", -1, "", "is not JSON: " + what));
  }
  if (!json.is_object()) return unexpected(fault("", -1, "", "must be a JSON object"));
  JsonReader reader(json);
  ProblemFile file;
  OwnedProblem& p = file.problem;
  p.name = reader.text("name", name);
  if (!reader.has("n")) return unexpected(fault("n", -1, "", "is missing"));
  const double n_given = reader.number("n", 0.0);
  if (!reader.error() && !(n_given >= 1.0 && n_given < 268435456.0 && n_given == std::floor(n_given))) {
    reader.fail("n", -1, brief(json["n"]), "must be a whole number in [1, 2^28)");
  }
  if (reader.error()) return unexpected(*reader.error());
  const auto n = static_cast<std::size_t>(n_given);
  p.c0 = reader.number("c0", 0.0);
  if (!reader.has("g")) reader.fail("g", -1, "", "is missing");
  p.g = reader.vector("g", n);
  p.Q = reader.matrix("Q", n);
  p.A = reader.matrix("A", n);
  p.b = reader.vector("b");
  p.C = reader.matrix("C", n);
  p.d = reader.vector("d");
  p.L = reader.matrix("L", n);
  p.l = reader.vector("l");
  p.R = reader.matrix("R", n);
  p.r = reader.vector("r");
  if (reader.has("x0")) p.initial_z = reader.vector("x0", n);
  if (reader.has("best_known_objective"))
    file.best_known_objective = reader.number("best_known_objective", 0.0);
  if (reader.error()) return unexpected(*reader.error());
  if (auto valid = check(p); !valid) return unexpected(valid.error());
  return file;
}

SparseMatrix owned(const SparseMatrixView& view) {
  return {view.rows,
          view.columns,
          {view.column_pointers.begin(), view.column_pointers.end()},
          {view.row_indices.begin(), view.row_indices.end()},
          {view.values.begin(), view.values.end()}};
}

Expected<ProblemFile> parse_binary(std::string_view content, const std::string& name) {
  v1::Problem message;
  if (content.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()) ||
      !message.ParseFromArray(content.data(), static_cast<int>(content.size()))) {
    return unexpected(
        fault("", -1, "", "is not a marble.v1.Problem message (truncated or of another format)"));
  }
  const ProblemView view = view_of(message);
  if (const auto valid = Problem::create(view); !valid) return unexpected(valid.error());
  const auto copy = [](std::span<const double> values) {
    return std::vector<double>(values.begin(), values.end());
  };
  ProblemFile file;
  OwnedProblem& p = file.problem;
  p.name = message.name().empty() ? name : message.name();
  p.Q = owned(view.Q);
  p.hessian_form = view.hessian_form;
  p.g = copy(view.g);
  p.c0 = view.c0;
  p.A = owned(view.A);
  p.b = copy(view.b);
  p.C = owned(view.C);
  p.d = copy(view.d);
  p.L = owned(view.L);
  p.l = copy(view.l);
  p.R = owned(view.R);
  p.r = copy(view.r);
  return file;
}

Json triplets(const SparseMatrix& m, Index rows, Index columns, bool mirror) {
  Json i = Json::array();
  Json j = Json::array();
  Json v = Json::array();
  const auto add = [&](Index row, Index column, double value) {
    i.push_back(row);
    j.push_back(column);
    v.push_back(value);
  };
  for (Index column = 0; column < m.columns && !m.values.empty(); ++column) {
    for (Index k = m.column_pointers[column]; k < m.column_pointers[column + 1]; ++k) {
      add(m.row_indices[k], column, m.values[k]);
      if (mirror && m.row_indices[k] != column) add(column, m.row_indices[k], m.values[k]);
    }
  }
  return {{"rows", rows}, {"cols", columns}, {"i", i}, {"j", j}, {"v", v}};
}

std::string write_json(const ProblemFile& file) {
  const OwnedProblem& p = file.problem;
  const auto n = static_cast<Index>(p.g.size());
  const auto rows = [](const std::vector<double>& offsets) { return static_cast<Index>(offsets.size()); };
  nlohmann::ordered_json json;
  json["name"] = p.name;
  if (file.best_known_objective) json["best_known_objective"] = *file.best_known_objective;
  json["n"] = n;
  json["c0"] = p.c0;
  json["g"] = p.g;
  json["Q"] = triplets(p.Q, n, n, p.hessian_form == HessianForm::upper_triangle);
  json["A"] = triplets(p.A, rows(p.b), n, false);
  json["b"] = p.b;
  json["C"] = triplets(p.C, rows(p.d), n, false);
  json["d"] = p.d;
  json["L"] = triplets(p.L, rows(p.l), n, false);
  json["l"] = p.l;
  json["R"] = triplets(p.R, rows(p.r), n, false);
  json["r"] = p.r;
  json["x0"] = p.initial_z.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(p.initial_z);
  return json.dump() + "\n";
}

}  // namespace

Expected<FileFormat> format_of_path(const std::string& path) {
  const auto ends_with = [&path](std::string_view suffix) {
    return std::string_view(path).ends_with(suffix);
  };
  if (ends_with(".json")) return FileFormat::json;
  if (ends_with(".pb") || ends_with(".bin")) return FileFormat::binary;
  return unexpected(fault("", -1, "", "must end in .json, .pb or .bin: the extension tells the format"));
}

Expected<ProblemFile> parse_problem(std::string_view content, FileFormat format, const std::string& name) {
  return format == FileFormat::json ? parse_json(content, name) : parse_binary(content, name);
}

Expected<ProblemFile> read_problem(const std::string& path) {
  std::string content;
  std::string name = "stdin";
  if (path == "-") {
    content.assign(std::istreambuf_iterator<char>(std::cin), {});
  } else {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream buffer;
    buffer << file.rdbuf();
    if (!file.is_open() || file.bad())
      return unexpected(Error{ErrorCode::not_found, "", -1, "", "cannot be read"});
    content = std::move(buffer).str();
    name = path.substr(path.find_last_of('/') + 1);
    name = name.substr(0, name.rfind('.'));
  }
  auto format = format_of_path(path);
  if (!format) {
    const std::size_t first = content.find_first_not_of(" \t\r\n");
    format = first != std::string::npos && content[first] == '{' ? FileFormat::json : FileFormat::binary;
  }
  return parse_problem(content, *format, name);
}

std::string write_problem(const ProblemFile& file, FileFormat format) {
  if (format == FileFormat::json) return write_json(file);
  v1::Problem message;
  to_message(file.problem.view(), &message);
  message.set_name(file.problem.name);
  return message.SerializeAsString();
}

}  // namespace marble
