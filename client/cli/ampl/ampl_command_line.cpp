#include "ampl/ampl_command_line.h"

#include <cstdio>
#include <sstream>
#include <string_view>

#include "ampl/nonlinear.h"
#include "base/option_text.h"
#include "marble/contract.h"

namespace marble::cli::ampl {
namespace {

constexpr std::string_view kNl = ".nl";

struct Word {
  const char* name;
  const char* doc;
};
constexpr Word kServer = {"server",
                          "where to solve: host:port, unix:PATH, or local for this process; MARBLE_SERVER"};
constexpr Word kOutlev = {"outlev", "1: a row an iteration on standard output; 0"};

}  // namespace

bool is_ampl(int argc, const char* const* argv) {
  if (argc < 2) return false;
  const std::string_view first = argv[1];
  if (first == "-v" || first == "-=" || (first.starts_with("-o") && first.size() > 2)) return true;
  for (int k = 1; k < argc; ++k) {
    if (std::string_view(argv[k]) == "-AMPL") return true;
  }
  return false;
}

Expected<CommandLine> parse(int argc, const char* const* argv) {
  CommandLine line;
  for (int k = 1; k < argc; ++k) {
    const std::string_view word = argv[k];
    if (word == "-v") {
      line.asks = CommandLine::Asks::version;
    } else if (word == "-=") {
      line.asks = CommandLine::Asks::options;
    } else if (word == "-AMPL") {
      line.from_ampl = true;
    } else if (word.starts_with("-o") && word.size() > 2) {
      line.sol_path = word.substr(2);
    } else if (word.starts_with('-')) {
      return unexpected(invalid(std::string(word), "", "must be -AMPL, -oFILE, -v or -="));
    } else if (line.stub.empty()) {
      line.stub = word.ends_with(kNl) ? word.substr(0, word.size() - kNl.size()) : word;
    } else {
      line.assignments.emplace_back(word);
    }
  }
  if (line.asks != CommandLine::Asks::solve) return line;
  if (line.stub.empty()) return unexpected(invalid("STUB", "", "is missing: the .nl file to solve"));
  if (line.sol_path.empty()) line.sol_path = line.stub + ".sol";
  return line;
}

std::vector<std::string> assignments_of(const std::string& text) {
  std::vector<std::string> all;
  std::istringstream words(text);
  bool value_follows = false;
  for (std::string word; words >> word;) {
    if (!all.empty() && (value_follows || word.starts_with('='))) {
      all.back() += word;
    } else {
      all.push_back(word);
    }
    value_follows = word.ends_with('=');
  }
  return all;
}

Expected<void> apply(const std::vector<std::string>& assignments, Settings& settings) {
  for (const std::string& assignment : assignments) {
    const std::size_t equals = assignment.find('=');
    const std::string name = assignment.substr(0, equals);
    const std::string value = equals == std::string::npos ? "true" : assignment.substr(equals + 1);
    if (name == kServer.name) {
      settings.server = value;
    } else if (name == kOutlev.name) {
      if (value != "0" && value != "1") return unexpected(invalid(name, value, "must be 0 or 1"));
      settings.reports = value == "1";
    } else {
      if (auto set = set_nonlinear_text(settings.nonlinear, name, value); !set) return set;
      if (is_nonlinear_word(name)) continue;
      if (auto set = set_option_text(settings.options, name, value); !set) return set;
    }
  }
  return {};
}

void print_options() {
  for (const Word& word : {kServer, kOutlev}) std::printf("%-26s %s\n", word.name, word.doc);
  for (const NonlinearWord& word : nonlinear_words())
    std::printf("%-26s %s; %s\n", word.name, word.doc, word.value);
  for (const OptionInfo& option : option_table()) {
    std::printf("%-26s %s; %s\n", std::string(option.name).c_str(), std::string(option.doc).c_str(),
                option_text(option, option.default_value).c_str());
  }
}

}  // namespace marble::cli::ampl
