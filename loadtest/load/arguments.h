// The command line of marble-load.
#pragma once

#include <string>
#include <vector>

#include "marble/connect_options.h"
#include "plan/plan.h"
#include "run/ramp.h"

namespace marble::load {

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
  std::vector<double> levels;        ///< of the capacity; empty unless it is about overload
  std::vector<std::string> allowed;  ///< error codes that are no failures
  bool json = false, quiet = false;
  std::string json_file, html_file, csv_file;
  std::string command;  ///< as it was given
};

enum ExitCode {
  kGood = 0,         ///< every answer came and was right
  kFailures = 1,     ///< errors, wrong answers or given-up requests; of a ramp: no rate held the objective
  kBadInput = 2,     ///< usage, or a file that is wrong
  kUnreachable = 3,  ///< the server is away, or refused a session
};

/// Parses, or prints help or what is wrong; then false, and the exit code.
[[nodiscard]] bool parse_arguments(int argc, char** argv, Arguments& arguments, int& exit_code);

/// The scenario that they ask for. Errors: those of files, bad names, ranges.
[[nodiscard]] Expected<Scenario> scenario_of(const Arguments& arguments);

}  // namespace marble::load
