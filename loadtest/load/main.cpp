// marble-load: see --help.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include "base/interrupt.h"
#include "marble/connect_options.h"
#include "marble/version.h"
#include "plain_text.h"
#include "plan.h"
#include "ramp.h"
#include "report.h"
#include "run.h"

namespace marble::load {
namespace {

// Parses the command line of marble-load.
struct Arguments {
  bool is_ramp = false;
  std::string server, token_file;
  ConnectOptions connect;
  std::string scenario_file, problem = "hopper";
  int size = 0, variants = 1;
  bool cold = false;
  std::string priority;
  double deadline_s = 0.0;
  std::vector<std::string> options;  ///< NAME=VALUE
  Plan plan;
  RampPlan ramp;
  std::vector<double> levels;        ///< multiples of the capacity; empty unless it measures overload
  std::vector<std::string> allowed;  ///< error codes that do not count as failures
  bool json = false, quiet = false;
  std::string json_file, csv_file;
  std::string command;  ///< the original command
};

enum ExitCode {
  kGood = 0,         ///< every solution arrived and was correct
  kFailures = 1,     ///< errors, wrong solutions or abandoned requests; of a ramp: no rate met the objective
  kBadInput = 2,     ///< wrong usage, or an invalid file
  kUnreachable = 3,  ///< the server is unreachable, or refused a session
};

constexpr int kMostClients = 10'000;

constexpr const char* kFooter =
    "Latency counts from the intended time of sending: a stall delays every request that was due in it, and "
    "all of "
    "them are counted.\n"
    "Exit codes: 0 every answer came and was right, 1 failures (of a ramp: no rate held the objective), 2 "
    "usage or "
    "a bad file,\n3 the server is away or refused. Ctrl-C ends early with the report so far.";

void add_server(CLI::App& command, Arguments& a) {
  a.server = default_server_address();
  a.connect = ConnectOptions::from_environment();
  command.add_option("--server", a.server, "host:port or unix:PATH")->capture_default_str();
  command.add_option("--token-file", a.token_file,
                     "its first line is the token to show; default MARBLE_TOKEN");
  command.add_flag("--tls", a.connect.tls, "encrypt; any other --tls option does so too");
  command.add_option("--tls-ca", a.connect.tls_ca, "PEM file of who may vouch for the server");
  command.add_option("--tls-certificate", a.connect.tls_certificate, "PEM file of the own certificate");
  command.add_option("--tls-key", a.connect.tls_key, "PEM file of its key");
  command.add_option("--tls-server-name", a.connect.tls_server_name, "the name in the server's certificate");
  command.add_option("--client-name", a.connect.name, "what to be called where there is no token");
}

void add_requests(CLI::App& command, Arguments& a) {
  auto* scenario = command.add_option("--scenario", a.scenario_file,
                                      "TOML file with a mix of problems; else one problem:");
  const auto add = [&](CLI::Option* option) { option->excludes(scenario); };
  add(command.add_option("--problem", a.problem, "hopper, rocket, gates, qpec, jr1, or a problem file")
          ->capture_default_str());
  add(command.add_option("--size", a.size, "of the example: steps, or variables of qpec")
          ->check(CLI::Range(1, 100'000)));
  add(command
          .add_option("--variants", a.variants, "of the example, numbers varied by a few percent, in turns")
          ->check(CLI::Range(1, 1000)));
  add(command.add_flag("--cold", a.cold, "sessions start each solve from scratch"));
  add(command.add_option("--priority", a.priority, "realtime, interactive or batch")
          ->check(CLI::IsMember({"realtime", "interactive", "batch"})));
  add(command.add_option("--deadline", a.deadline_s, "seconds until an answer is of no use")
          ->check(CLI::Range(1e-3, 1e6)));
  add(command.add_option("--option", a.options, "a solver option, NAME=VALUE; may be repeated"));
  const std::map<std::string, Mode> modes = {{"unary", Mode::unary},
                                             {"streamed", Mode::streamed},
                                             {"session", Mode::session},
                                             {"batch", Mode::batch}};
  command.add_option("--mode", a.plan.mode, "unary, streamed, session or batch")
      ->transform(CLI::CheckedTransformer(modes).description(""))
      ->type_name("TEXT");
}

void add_measurement(CLI::App& command, Arguments& a) {
  command
      .add_option(
          "--clients", a.plan.clients,
          "closed loop: that ask, each again when answered; open loop: among which requests are dealt")
      ->check(CLI::Range(1, kMostClients))
      ->capture_default_str();
  command
      .add_option("--connections", a.plan.connections, "that the clients share; default one each, at most 32")
      ->check(CLI::Range(1, 1000));
  command.add_option("--warm-up", a.plan.warm_up_s, "seconds that are not measured")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command.add_option("--duration", a.plan.duration_s, "seconds that are measured")
      ->check(CLI::Range(0.1, 1e6))
      ->capture_default_str();
  command.add_option("--check", a.plan.check, "part of the answers that is checked independently")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command.add_option("--in-flight", a.plan.in_flight, "open loop: most requests under way at once")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  command.add_option("--patience", a.plan.patience_s, "seconds to wait for answers after the last request")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command.add_option("--seed", a.plan.seed, "of arrivals and of the mix")->capture_default_str();
  const std::map<std::string, ArrivalProcess> processes = {{"poisson", ArrivalProcess::poisson},
                                                           {"fixed", ArrivalProcess::fixed}};
  command.add_option("--arrivals", a.plan.arrivals, "poisson or fixed")
      ->transform(CLI::CheckedTransformer(processes).description(""))
      ->type_name("TEXT");
  command.add_option("--allow", a.allowed,
                     "an error code that is no failure, as resource_exhausted; repeatable");
  command.add_flag("--json", a.json, "one JSON object on standard output instead of the table");
  command.add_option("--json-file", a.json_file, "write the JSON there as well; loadtest/plot draws it");
  command.add_flag("--quiet", a.quiet, "no line a second on standard error");
}

void add_all(CLI::App& command, Arguments& a) {
  add_server(command, a);
  add_requests(command, a);
  add_measurement(command, a);
}

std::string shell_line(int argc, char** argv) {
  std::string line = "marble-load";
  for (int i = 1; i < argc; ++i) line += std::string(" ") + argv[i];
  return line;
}

// Parses; on help or an error prints it and returns false and the exit code.
bool parse_arguments(int argc, char** argv, Arguments& a, int& exit_code) {
  CLI::App program("Loads a Marble server and reports what it sustains.", "marble-load");
  program.set_version_flag("--version", std::string("marble-load ") + kVersion);
  program.require_subcommand(1);
  program.get_formatter()->column_width(34);
  program.footer(kFooter);

  CLI::App* closed = program.add_subcommand("closed", "Clients that ask again as soon as they are answered");
  add_all(*closed, a);
  closed->add_option("--count", a.plan.count, "measure this many requests instead of a duration")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000'000'000}));
  CLI::App* open = program.add_subcommand("open", "Requests at a rate, whether answered or not");
  add_all(*open, a);
  open->add_option("--rate", a.plan.rate_per_s, "requests a second")
      ->required()
      ->check(CLI::Range(1e-3, 1e6));
  open->add_option("--count", a.plan.count, "measure this many requests instead of a duration")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000'000'000}));
  CLI::App* ramp = program.add_subcommand("ramp", "Find the highest rate at which an objective holds");
  add_all(*ramp, a);
  std::string objective;
  ramp->add_option("--objective", objective, "the latency to hold, as p99=50ms")->required();
  ramp->add_option("--rate", a.ramp.first_rate_per_s, "first rate to try")
      ->check(CLI::Range(1e-3, 1e6))
      ->capture_default_str();
  ramp->add_option("--precision", a.ramp.precision, "stop when the limit is known to this part")
      ->check(CLI::Range(0.001, 1.0))
      ->capture_default_str();
  ramp->add_option("--errors", a.ramp.most_errors, "part of the requests that may fail")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  CLI::App* overload =
      program.add_subcommand("overload", "How much arrives in time at multiples of the capacity");
  add_all(*overload, a);
  std::vector<double> levels = {0.7, 2.0, 4.0, 8.0};
  overload->add_option("--levels", levels, "of the capacity, which is measured first")
      ->delimiter(',')
      ->check(CLI::Range(0.01, 1000.0))
      ->capture_default_str();
  overload->add_option("--csv-file", a.csv_file, "write the table there as CSV");
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    exit_code = program.exit(error) == 0 ? kGood : kBadInput;
    return false;
  }
  a.is_ramp = ramp->parsed();
  if (overload->parsed()) {
    a.levels = levels;
    a.allowed.insert(a.allowed.end(), {"resource_exhausted", "deadline_exceeded"});
  }
  a.plan.loop = closed->parsed() ? Loop::closed : Loop::open;
  if (a.is_ramp) {
    const auto parsed = parse_objective(objective);
    if (!parsed) {
      std::cerr << "marble-load: " << without_controls(parsed.error().message()) << '\n';
      exit_code = kBadInput;
      return false;
    }
    a.ramp.objective = *parsed;
  }
  const CLI::App* used = program.get_subcommands().front();
  if (used->count("--clients") == 0 && a.plan.loop == Loop::open) a.plan.clients = 8;
  if (used->count("--connections") == 0) a.plan.connections = std::min(a.plan.clients, 32);
  a.command = shell_line(argc, argv);
  return true;
}

// Returns the requested scenario. Errors: those of files, bad names, ranges.
Expected<Scenario> scenario_of(const Arguments& a) {
  if (!a.scenario_file.empty()) return read_scenario(a.scenario_file);
  Entry entry = single_entry(a.problem);
  entry.size = a.size;
  entry.variants = a.variants;
  if (!entry.file.empty() && (a.size != 0 || a.variants != 1))
    return unexpected(invalid("--size, --variants", "", "are of built-in examples, not of a file"));
  entry.cold = a.cold;
  entry.deadline_s = a.deadline_s;
  for (const Priority known : {Priority::realtime, Priority::interactive, Priority::batch}) {
    if (a.priority == marble::to_string(known)) entry.priority = known;
  }
  for (const std::string& option : a.options) {
    const std::size_t equals = option.find('=');
    if (equals == std::string::npos) return unexpected(invalid("--option", option, "must be NAME=VALUE"));
    MARBLE_RETURN_IF_ERROR(
        set_option_text(entry.options, option.substr(0, equals), option.substr(equals + 1)));
  }
  return Scenario{{entry}};
}

int fails(const Error& error) {
  std::cerr << "marble-load: " << without_controls(error.message()) << '\n';
  const bool input = error.code == ErrorCode::invalid_argument || error.code == ErrorCode::not_found;
  return input ? kBadInput : kUnreachable;
}

Expected<void> read_token(Arguments& a) {
  if (a.token_file.empty()) return {};
  std::ifstream file(a.token_file);
  if (std::getline(file, a.connect.token)) return {};
  return unexpected(failure(ErrorCode::not_found, "--token-file", a.token_file, "cannot be read"));
}

bool write(const std::string& path, const std::string& content) {
  if (path.empty()) return true;
  std::ofstream file(path, std::ios::binary);
  file << content;
  file.close();
  if (file) return true;
  std::cerr << "marble-load: cannot write " << without_controls(path) << '\n';
  return false;
}

// Prints a line for a person who watches.
void report_second(const Second& second) {
  std::fprintf(
      stderr, "\r%6.0f s  %8llu answers/s  %6llu errors/s  median %8.2f ms  p99 %8.2f ms  queued %d   ",
      second.at_s, static_cast<unsigned long long>(second.answers),
      static_cast<unsigned long long>(second.errors), 1e3 * second.p50_s, 1e3 * second.p99_s, second.queued);
}

std::uint64_t failures(const RunResult& result, const std::vector<std::string>& allowed) {
  std::uint64_t count = result.failures();
  for (const auto& [code, times] : result.tally.sum().errors) {
    if (std::ranges::find(allowed, code) != allowed.end()) count -= times;
  }
  return count;
}

template <class Report>
int report(const Arguments& a, const Report& report, int exit_code) {
  const std::string json = report.json().dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  std::cout << (a.json ? json : report.text()) << std::flush;
  return write(a.json_file, json) ? exit_code : kBadInput;
}

int run_program(Arguments& a) {
  if (auto token = read_token(a); !token) return fails(token.error());
  const auto scenario = scenario_of(a);
  if (!scenario) return fails(scenario.error());
  const auto entries = load(*scenario, a.plan.mode);
  if (!entries) return fails(entries.error());
  const auto target = Target::open(a.server, a.connect, a.plan.connections);
  if (!target) return fails(target.error());
  ConnectOptions watching = a.connect;
  watching.own_connection = true;
  const auto server = Client::connect(a.server, watching);
  if (!server) return fails(server.error());
  const auto info = server->info();
  if (!info) return fails(info.error());
  Subject subject{a.command, a.server, info->version, info->workers, this_machine(), {}};
  for (const LoadedEntry& entry : *entries) subject.entries.push_back(entry.entry.name);

  const bool watched = !a.quiet && isatty(STDERR_FILENO) != 0;
  const RunParts parts{*target, *server, *entries,
                       watched ? report_second : std::function<void(const Second&)>()};
  const cli::Interrupt interrupt;
  if (a.is_ramp) {
    const auto reported = [&](const RampStep& step) {
      if (!a.quiet) std::cerr << (watched ? "\r" : "") << text_line(step, a.ramp.objective);
    };
    const auto result = ramp(parts, a.plan, a.ramp, interrupt.token(), reported);
    if (!result) return fails(result.error());
    struct Report {
      const Subject& subject;
      const RampResult& result;
      const Objective& objective;
      [[nodiscard]] std::string text() const { return text_report(subject, result, objective); }
      [[nodiscard]] Json json() const { return json_report(subject, result, objective); }
    };
    return report(a, Report{subject, *result, a.ramp.objective},
                  result->best_rate_per_s > 0.0 ? kGood : kFailures);
  }
  if (!a.levels.empty()) {
    const auto reported = [&](const OverloadStep& step) {
      if (!a.quiet) std::cerr << (watched ? "\r" : "") << text_line(step);
    };
    const auto result = overload(parts, a.plan, a.levels, info->workers, interrupt.token(), reported);
    if (!result) return fails(result.error());
    struct Report {
      const Subject& subject;
      const OverloadResult& result;
      [[nodiscard]] std::string text() const { return text_report(subject, result); }
      [[nodiscard]] Json json() const { return json_report(subject, result); }
    };
    if (result->steps.empty()) return kFailures;  // interrupted, or no results
    std::uint64_t failed = 0;
    for (const OverloadStep& step : result->steps) failed += failures(step.result, a.allowed);
    if (!write(a.csv_file, csv_report(*result))) return kBadInput;
    return report(a, Report{subject, *result}, failed == 0 ? kGood : kFailures);
  }
  const auto result = run(parts, a.plan, interrupt.token());
  if (watched) std::cerr << '\n';
  if (!result) return fails(result.error());
  struct Report {
    const Subject& subject;
    const RunResult& result;
    [[nodiscard]] std::string text() const { return text_report(subject, result); }
    [[nodiscard]] Json json() const { return json_report(subject, result); }
  };
  return report(a, Report{subject, *result}, failures(*result, a.allowed) == 0 ? kGood : kFailures);
}

}  // namespace
}  // namespace marble::load

int main(int argc, char** argv) {
  using namespace marble::load;
  Arguments arguments;
  int exit_code = kGood;
  try {
    if (!parse_arguments(argc, argv, arguments, exit_code)) return exit_code;
    return run_program(arguments);
  } catch (const std::exception& error) {
    std::cerr << "marble-load: " << marble::without_controls(error.what()) << '\n';
    return kBadInput;
  }
}
