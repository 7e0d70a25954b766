#include "config.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <iomanip>
#include <iostream>
#include <sstream>

#include "marble/version.h"

namespace marble::server {
namespace {

std::string flag_name(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return "--" + name;
}

std::string variable_name(std::string name) {
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::toupper(c); });
  return "MARBLE_" + name;
}

template <class Number>
std::string text_of(Number number) {
  std::ostringstream text;
  text << std::setprecision(17) << number;
  return text.str();
}

template <class Type>
void add_setting(CLI::App& app, const std::string& name, Type& value, Type low, Type high,
                 const std::string& unit, const std::string& doc) {
  const std::string text = unit.empty() ? doc : doc + " (" + unit + ")";
  if constexpr (std::is_same_v<Type, bool>) {
    app.add_flag(flag_name(name), value, text)->envname(variable_name(name));
  } else {
    // CLI::Range lets "nan" pass, which is neither below nor above.
    const CLI::Validator range(
        [low, high](const std::string& given) {
          Type number{};
          const bool inside = CLI::detail::lexical_cast(given, number) && number >= low && number <= high;
          return inside ? std::string() : given + " is not in [" + text_of(low) + ", " + text_of(high) + "]";
        },
        "in [" + text_of(low) + ", " + text_of(high) + "]");
    app.add_option(flag_name(name), value, text)
        ->envname(variable_name(name))
        ->check(range)
        ->capture_default_str();
  }
}

}  // namespace

std::optional<Config> read_config(int argc, char** argv, int& exit_code) {
  Config config;
  CLI::App app("Marble server: solves quadratic programs with complementarity constraints over gRPC.",
               "marble-server");
  app.set_version_flag("--version", std::string("marble-server ") + kVersion);
  app.get_formatter()->column_width(44);
  app.add_option("--listen", config.listen,
                 "address to listen on: host:port (port 0 takes a free one) or unix:PATH; "
                 "may be given several times")
      ->envname("MARBLE_LISTEN")
      ->delimiter(',')
      ->capture_default_str();
#define MARBLE_SETTING(type, name, default_value, low, high, unit, doc) \
  add_setting<type>(app, #name, config.name, low, high, unit, doc);
#define MARBLE_TEXT_SETTING(name, default_value, choices, doc)                                               \
  {                                                                                                          \
    CLI::Option* option = app.add_option(flag_name(#name), config.name, doc)->envname(variable_name(#name)); \
    if (const auto values = choices; !values.empty()) option->check(CLI::IsMember(values));                  \
    option->capture_default_str();                                                                           \
  }
#include "config.def"
#undef MARBLE_SETTING
#undef MARBLE_TEXT_SETTING
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    exit_code = app.exit(error) == 0 ? 0 : 2;
    return std::nullopt;
  }
  for (const std::string& address : config.listen) {
    if (!config.insecure && !is_local_address(address)) {
      std::cerr << "marble-server: --listen " << address
                << " is reachable from other machines and connections are not encrypted; "
                   "add --insecure if that is what you want\n";
      exit_code = 2;
      return std::nullopt;
    }
  }
  return config;
}

bool is_local_address(const std::string& address) {
  if (address.rfind("unix:", 0) == 0 || address.rfind("unix-abstract:", 0) == 0) return true;
  const std::string host = address.substr(0, address.rfind(':'));
  const auto all_of = [](const std::string& text, const char* allowed) {
    return text.find_first_not_of(allowed) == std::string::npos;
  };
  return host == "localhost" || host == "[::1]" ||
         (host.rfind("127.", 0) == 0 && all_of(host, "0123456789."));
}

}  // namespace marble::server
