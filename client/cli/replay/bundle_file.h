// Replay bundles as files.
#pragma once

#include <string>

#include "bundle.h"
#include "marble/jobs.h"

namespace marble::cli {

/// Errors: not_found (it cannot be written), and what write_bundle() says.
[[nodiscard]] Expected<void> save_bundle(const Bundle& bundle, const std::string& path);
/// The same of what a server told.
[[nodiscard]] Expected<void> save_bundle(const JobBundle& parts, const std::string& path);

/// Errors: not_found (it cannot be read), and what read_bundle() says.
[[nodiscard]] Expected<Bundle> load_bundle(const std::string& path);

}  // namespace marble::cli
