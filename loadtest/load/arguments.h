// Parses the command line of marble-load.
#pragma once

#include <string>
#include <vector>

#include "marble/connect_options.h"
#include "plan.h"
#include "ramp.h"

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

/// Parses; on help or an error prints it and returns false and the exit code.
[[nodiscard]] bool parse_arguments(int argc, char** argv, Arguments& arguments, int& exit_code);

/// Returns the requested scenario. Errors: those of files, bad names, ranges.
[[nodiscard]] Expected<Scenario> scenario_of(const Arguments& arguments);

}  // namespace marble::load
