// Stores replay bundles in files.
#pragma once

#include <string>

#include "bundle.h"
#include "marble/jobs.h"

namespace marble::cli {

/// Errors: not_found (the file cannot be written), and those of write_bundle().
[[nodiscard]] Expected<void> save_bundle(const Bundle& bundle, const std::string& path);
/// The same for the parts that a server sent.
[[nodiscard]] Expected<void> save_bundle(const JobBundle& parts, const std::string& path);

/// Errors: not_found (the file cannot be read), and those of read_bundle().
[[nodiscard]] Expected<Bundle> load_bundle(const std::string& path);

}  // namespace marble::cli
