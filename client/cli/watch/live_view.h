// Implements `marble watch` on a terminal: a full screen that follows the server until the person quits.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "marble/client.h"
#include "terminal/screen.h"

namespace marble::cli {

/// How the view ended.
struct LiveEnd {
  std::optional<JobInfo> job;    ///< of one job: its last state
  std::optional<Error> refusal;  ///< the server rejected this caller
  int signal = 0;                ///< that ended it; 0: the person quit
};

/// Shows all jobs, or one. Returns with the terminal restored to its state before `screen`.
[[nodiscard]] LiveEnd watch_live(const Client& client, const std::string& job_id,
                                 std::unique_ptr<Screen> screen);

}  // namespace marble::cli
