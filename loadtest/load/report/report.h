// A run's findings: a table for people, JSON for programs, a page with plots.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "measure/machine.h"
#include "measure/result.h"
#include "plan/objective.h"
#include "plan/workload.h"

namespace marble::load {

/// What a report is about: the same for all runs of a ramp.
struct Subject {
  std::string command;  ///< that made it
  std::string address, server_version;
  int workers = 0;
  Machine machine;
  std::vector<std::string> entries;  ///< names
};

/// The part of a value's distribution that reports show: 0.5 to 0.9999.
[[nodiscard]] const std::vector<double>& shown_parts();

[[nodiscard]] std::string text_report(const Subject& subject, const RunResult& result);
[[nodiscard]] std::string text_report(const Subject& subject, const RampResult& result,
                                      const Objective& objective);
[[nodiscard]] std::string text_line(const RampStep& step, const Objective& objective);
[[nodiscard]] std::string text_report(const Subject& subject, const OverloadResult& result);
[[nodiscard]] std::string text_line(const OverloadStep& step);
/// One line a step, after one of names: as csv_report's table in loadtest/README.md.
[[nodiscard]] std::string csv_report(const OverloadResult& result);

/// schema "marble-load/1"; documented in loadtest/README.md. Times in seconds.
using Json = nlohmann::ordered_json;
[[nodiscard]] Json json_report(const Subject& subject, const RunResult& result);
[[nodiscard]] Json json_report(const Subject& subject, const RampResult& result, const Objective& objective);
[[nodiscard]] Json json_report(const Subject& subject, const OverloadResult& result);

/// One HTML file that needs nothing else, with plots as SVG, light or dark as the reader has it.
[[nodiscard]] std::string html_report(const Subject& subject, const RunResult& result);
[[nodiscard]] std::string html_report(const Subject& subject, const RampResult& result,
                                      const Objective& objective);

}  // namespace marble::load
