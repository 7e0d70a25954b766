// Formats a job: cells of a table, a line of text, a JSON object.
#pragma once

#include <string>

#include "marble/jobs.h"
#include "output/json.h"
#include "output/text_table.h"

namespace marble::cli {

/// Returns "solved", "error: deadline_exceeded", or "-" before the end.
[[nodiscard]] std::string ending(const JobInfo& job);

/// Returns seconds in few characters: "12 ms", "3.4 s", "5 min", "2 h", "3 d".
[[nodiscard]] std::string duration_text(double seconds);

/// Returns the time since the job was accepted, by this machine's clock.
[[nodiscard]] std::string age_text(const JobInfo& job);

[[nodiscard]] std::string sizes_text(const JobInfo& job);  ///< "n/n_e/n_i/n_c"

[[nodiscard]] Json to_json(const JobInfo& job);
[[nodiscard]] Json to_json(const Progress& row);

/// Returns the exit code of a command that waited for this job, which has finished.
[[nodiscard]] int exit_code_of(const JobInfo& job);

}  // namespace marble::cli
