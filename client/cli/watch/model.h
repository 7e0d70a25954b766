// Provides the data of the live view, as the server reports it.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "marble/jobs.h"
#include "watch/job_table.h"
#include "watch/server_state.h"
#include "watch/thinned.h"

namespace marble::cli {

/// The opened job, with its convergence.
struct OpenedJob {
  static constexpr std::size_t kNewestRows = 200;

  JobInfo job;
  Thinned<Progress, 1024> trace;  ///< the whole trace, for the plot
  std::deque<Progress> newest;    ///< for the table, oldest first
  std::int64_t skipped = 0;       ///< rows that were not sent because this reader was slow
  bool gone = false;              ///< the server does not know it any more

  /// A first event, or one with a trace, starts anew.
  void update(const JobEvent& event);

 private:
  void add(const Progress& row);
};

struct Model {
  std::string address;
  ServerState server;
  JobTable jobs;
  std::optional<OpenedJob> opened;
  std::string notice;  ///< the result of the last request, for a person
};

}  // namespace marble::cli
