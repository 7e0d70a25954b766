// `marble watch` on a terminal: a full screen that follows the server until the person leaves it.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "marble/client.h"
#include "terminal/screen.h"

namespace marble::cli {

/// How it was left.
struct LiveEnd {
  std::optional<JobInfo> job;    ///< of one job: as it was last
  std::optional<Error> refusal;  ///< the server would not have this caller
  int signal = 0;                ///< that ended it; 0: the person did
};

/// Shows all jobs, or one. Returns with the terminal as it was before `screen`, which it takes.
[[nodiscard]] LiveEnd watch_live(const Client& client, const std::string& job_id,
                                 std::unique_ptr<Screen> screen);

}  // namespace marble::cli
