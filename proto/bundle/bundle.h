// A replay bundle: one solve as a file, with all that it depends on and what came of it. A tar archive
// compressed by zstd, for bug reports: nothing in it says who asked, or from where.
//
//   bundle.json, job.pb     the marble.v1.JobBundle: version, processor, options, end; as text without the
//   trace request.pb              the marble.v1.SolveRequest problem.json            its problem as a problem
//   file, where it has one of its own answer.pb, answer.json  the marble.v1.SolveResponse; as text where it
//   has at most 16 MiB trace.csv               the convergence README.txt              what this is
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "marble/error.h"
#include "marble/v1/job.pb.h"

namespace marble {

/// What a bundle holds.
struct Bundle {
  v1::JobBundle facts;
  std::string request;  ///< a serialized marble.v1.SolveRequest, without request_id
  std::string answer;   ///< a serialized marble.v1.SolveResponse; empty if there is none
};

/// This program's version, build and processor.
void report_build(v1::JobBundle* facts);

/// Takes out what says who asked.
void make_anonymous(v1::JobBundle* facts);
/// The same of a serialized marble.v1.SolveRequest: its request_id. Others stay as they are.
void make_anonymous(std::string* request);

/// Takes more of a file; what it returns ends the writing.
using BundleSink = std::function<Expected<void>(std::string_view)>;

/// Writes the file. Errors: the sink's; invalid_argument (the request or the answer cannot be read).
[[nodiscard]] Expected<void> write_bundle(const Bundle& bundle, const BundleSink& sink);

/// Reads a file's bytes: bundle, request and answer, by the last part of their names; all else is passed
/// over. All of it may unpack to 256 MiB and 100 times the file's bytes, the parts that are read and what
/// they become in memory take 64 MiB and 100 times these. Errors: invalid_argument (no zstd, no tar, damaged,
/// cut off, too large, a part is missing, there twice or no such message).
[[nodiscard]] Expected<Bundle> read_bundle(std::string_view file);

}  // namespace marble
