// marble-load: see --help.
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iostream>

#include "arguments.h"
#include "base/interrupt.h"
#include "plain_text.h"
#include "ramp.h"
#include "report.h"
#include "run.h"

namespace marble::load {
namespace {

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
