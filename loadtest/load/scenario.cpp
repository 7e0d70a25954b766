#include "scenario.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>
#include <string_view>

#include "guarded_toml.h"

namespace marble::load {
namespace {

constexpr std::string_view kExamplesText = "hopper, rocket, gates, qpec or jr1";
constexpr std::int64_t kMostVariants = 1000;
constexpr std::int64_t kLargestSize = 100'000;

// Keeps the first error of a scenario, with its line.
class Reader {
 public:
  Reader(const std::filesystem::path& path, Scenario& scenario) : path_(path), scenario_(scenario) {}

  Expected<void> read(const toml::table& root) {
    for (const auto& [key, node] : root) {
      if (key.str() != "entry") {
        fault(key.source(), std::string(key.str()), "", "is no key of a scenario; it has [[entry]] tables");
        continue;
      }
      const toml::array* list = node.as_array();
      if (list == nullptr || !list->is_homogeneous(toml::node_type::table)) {
        fault(key.source(), "entry", "", "must be written [[entry]]");
        continue;
      }
      for (const toml::node& table : *list) read_entry(*table.as_table());
    }
    if (!fault_ && scenario_.entries.empty()) fault({}, "entry", "", "there must be at least one [[entry]]");
    if (fault_) return unexpected(*fault_);
    return {};
  }

 private:
  using Where = toml::source_region;

  void fault(const Where& where, const std::string& key, std::string value, std::string rule) {
    if (fault_) return;
    std::string field = path_.string();
    if (where.begin.line > 0) field += ":" + std::to_string(where.begin.line);
    fault_ = invalid(field + ": " + key, std::move(value), std::move(rule));
  }
  static std::string text_of(const toml::node& node) {
    std::ostringstream out;
    node.visit([&](const auto& value) { out << value; });
    return out.str();
  }

  void read_entry(const toml::table& table) {
    Entry entry;
    for (const auto& [key, node] : table) read_key(entry, std::string(key.str()), node);
    if (entry.problem.empty() == entry.file.empty())
      fault(table.source(), "entry", "", "must have either problem or file");
    if (!entry.file.empty() && (entry.variants != 1 || entry.size != 0))
      fault(table.source(), "entry", "", "size and variants are of built-in examples, not of a file");
    if (entry.name.empty()) entry.name = entry.file.empty() ? entry.problem : entry.file.stem().string();
    if (!names_.insert(entry.name).second)
      fault(table.source(), "name", entry.name, "another entry has this name: give each its own");
    scenario_.entries.push_back(std::move(entry));
  }

  void read_key(Entry& entry, const std::string& key, const toml::node& node) {
    if (key == "name")
      entry.name = text(key, node);
    else if (key == "problem")
      entry.problem = one_of(key, node, example_names(), kExamplesText);
    else if (key == "file")
      entry.file = path_.parent_path() / text(key, node);
    else if (key == "size")
      entry.size = static_cast<int>(whole(key, node, 1, kLargestSize));
    else if (key == "variants")
      entry.variants = static_cast<int>(whole(key, node, 1, kMostVariants));
    else if (key == "weight")
      entry.weight = number(key, node, 1e-6, 1e6);
    else if (key == "mode")
      entry.mode = mode(key, node);
    else if (key == "priority")
      entry.priority = priority(key, node);
    else if (key == "deadline_s")
      entry.deadline_s = number(key, node, 1e-3, 1e6);
    else if (key == "cold")
      entry.cold = truth(key, node);
    else if (key == "progress_interval_s")
      entry.progress_interval_s = number(key, node, 0.0, 1e6);
    else if (key == "options")
      read_options(entry, node);
    else
      fault(node.source(), key, "", "is no key of an entry");
  }

  std::string text(const std::string& key, const toml::node& node) {
    if (const auto* value = node.as_string(); value != nullptr && !value->get().empty()) return value->get();
    fault(node.source(), key, text_of(node), "must be a text");
    return "";
  }
  std::string one_of(const std::string& key, const toml::node& node, const std::vector<std::string>& known,
                     std::string_view rule) {
    const std::string value = text(key, node);
    if (std::ranges::find(known, value) == known.end())
      fault(node.source(), key, value, "must be " + std::string(rule));
    return value;
  }
  bool truth(const std::string& key, const toml::node& node) {
    if (const auto* value = node.as_boolean()) return value->get();
    fault(node.source(), key, text_of(node), "must be true or false");
    return false;
  }
  double number(const std::string& key, const toml::node& node, double low, double high) {
    const std::optional<double> value = node.value<double>();
    if (value && !node.is_boolean() && *value >= low && *value <= high) return *value;
    std::ostringstream rule;
    rule << "must be a number in [" << low << ", " << high << "]";
    fault(node.source(), key, text_of(node), rule.str());
    return low;
  }
  std::int64_t whole(const std::string& key, const toml::node& node, std::int64_t low, std::int64_t high) {
    const auto* value = node.as_integer();
    if (value != nullptr && value->get() >= low && value->get() <= high) return value->get();
    fault(node.source(), key, text_of(node),
          "must be a whole number in [" + std::to_string(low) + ", " + std::to_string(high) + "]");
    return low;
  }
  Mode mode(const std::string& key, const toml::node& node) {
    const std::string value =
        one_of(key, node, {"unary", "streamed", "session", "batch"}, "unary, streamed, session or batch");
    for (const Mode known : {Mode::unary, Mode::streamed, Mode::session, Mode::batch}) {
      if (value == to_string(known)) return known;
    }
    return Mode::unary;
  }
  Priority priority(const std::string& key, const toml::node& node) {
    const std::string value =
        one_of(key, node, {"realtime", "interactive", "batch"}, "realtime, interactive or batch");
    for (const Priority known : {Priority::realtime, Priority::interactive, Priority::batch}) {
      if (value == marble::to_string(known)) return known;
    }
    return Priority::by_method;
  }

  void read_options(Entry& entry, const toml::node& node) {
    const toml::table* table = node.as_table();
    if (table == nullptr) return fault(node.source(), "options", text_of(node), "must be a table");
    for (const auto& [key, value] : *table) {
      const std::string name(key.str());
      const auto* word = value.as_string();
      if (const auto set = set_option_text(entry.options, name, word ? word->get() : text_of(value)); !set)
        fault(value.source(), "options." + name, text_of(value), set.error().bound);
    }
  }

  const std::filesystem::path& path_;
  Scenario& scenario_;
  std::set<std::string> names_;
  std::optional<Error> fault_;
};

}  // namespace

const char* to_string(Mode mode) {
  switch (mode) {
    case Mode::unary:
      return "unary";
    case Mode::streamed:
      return "streamed";
    case Mode::session:
      return "session";
    case Mode::batch:
      return "batch";
  }
  return "?";
}

Entry single_entry(const std::string& problem) {
  Entry entry;
  entry.name = problem;
  const auto& known = example_names();
  if (std::ranges::find(known, problem) != known.end()) {
    entry.problem = problem;
  } else {
    entry.file = problem;
    entry.name = entry.file.stem().string();
  }
  return entry;
}

Expected<Scenario> parse_scenario(const std::string& text, const std::filesystem::path& path) {
  const toml::parse_result parsed = toml::parse(text, path.string());
  if (!parsed) {
    const auto& error = parsed.error();
    return unexpected(invalid(path.string() + ":" + std::to_string(error.source().begin.line), "",
                              std::string(error.description())));
  }
  Scenario scenario;
  MARBLE_RETURN_IF_ERROR(Reader(path, scenario).read(parsed.table()));
  return scenario;
}

Expected<Scenario> read_scenario(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf()))
    return unexpected(failure(ErrorCode::not_found, path.string(), "cannot be read"));
  return parse_scenario(text.str(), path);
}

}  // namespace marble::load
