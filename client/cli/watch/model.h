// Provides the data of the live view, as the server reports it.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "marble/jobs.h"
#include "marble/server_info.h"
#include "watch/job_table.h"
#include "watch/thinned.h"

namespace marble::cli {

/// Rates between the counters of two times.
struct Rates {
  double answers_per_s = 0.0;
  std::optional<double> solved_share;  ///< share of solved results; absent if there were none
  double busy_workers = 0.0;           ///< on average
  double cpu_share = 0.0;              ///< of one core; may exceed 1
};

/// Returns the rates between two reads. Results of sessions' updates count like those of jobs. Absent if the
/// counters are not comparable: no time passed, or another server responds now.
[[nodiscard]] std::optional<Rates> rates_between(const ServerInfo& earlier, const ServerInfo& later);

/// The server: its counters, their rates, and whether it is reachable.
class ServerState {
 public:
  /// `draining`: the server finishes its jobs and accepts no new ones.
  void saw(const ServerInfo& info, bool draining = false);
  /// The server did not respond, for this reason, at `now_s` of a steady clock.
  void lost(const std::string& why, double now_s);

  [[nodiscard]] const std::optional<ServerInfo>& info() const { return info_; }
  [[nodiscard]] const std::optional<Rates>& rates() const { return rates_; }
  [[nodiscard]] bool draining() const { return draining_; }
  [[nodiscard]] bool connected() const { return why_lost_.empty(); }
  [[nodiscard]] const std::string& why_lost() const { return why_lost_; }
  [[nodiscard]] double lost_since_s() const { return lost_since_s_; }

 private:
  std::optional<ServerInfo> info_;
  std::optional<Rates> rates_;
  bool draining_ = false;
  std::string why_lost_;  // empty: connected
  double lost_since_s_ = 0.0;
};

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
