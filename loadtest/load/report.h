// Reports the results of a run: a table for people, JSON for programs and for loadtest/plot.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "machine.h"
#include "objective.h"
#include "result.h"
#include "workload.h"

namespace marble::load {

/// The subject of a report: the same for all runs of a ramp.
struct Subject {
  std::string command;  ///< the command line of the run
  std::string address, server_version;
  int workers = 0;
  Machine machine;
  std::vector<std::string> entries;  ///< names
};

/// Returns the parts of a distribution that reports show: 0.5 to 0.9999.
[[nodiscard]] const std::vector<double>& shown_parts();

[[nodiscard]] std::string text_report(const Subject& subject, const RunResult& result);
[[nodiscard]] std::string text_report(const Subject& subject, const RampResult& result,
                                      const Objective& objective);
[[nodiscard]] std::string text_line(const RampStep& step, const Objective& objective);
[[nodiscard]] std::string text_report(const Subject& subject, const OverloadResult& result);
[[nodiscard]] std::string text_line(const OverloadStep& step);
/// Returns a header line and one line per step: the table of csv_report in loadtest/README.md.
[[nodiscard]] std::string csv_report(const OverloadResult& result);

/// Schema "marble-load/1"; documented in loadtest/README.md. Times in seconds.
using Json = nlohmann::ordered_json;
[[nodiscard]] Json json_report(const Subject& subject, const RunResult& result);
[[nodiscard]] Json json_report(const Subject& subject, const RampResult& result, const Objective& objective);
[[nodiscard]] Json json_report(const Subject& subject, const OverloadResult& result);

}  // namespace marble::load
