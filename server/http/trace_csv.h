// A job's progress as a table for spreadsheets and scripts.
#pragma once

#include <string>

#include "marble/v1/job.pb.h"

namespace marble::server::http {

/// RFC 4180: a line of names, then one a row; numbers keep every bit. The columns are those of `marble job
/// --trace`.
[[nodiscard]] std::string trace_csv(const v1::Trace& trace);

}  // namespace marble::server::http
