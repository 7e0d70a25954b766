// What the live view knows of the server: its numbers, what they mean a second, and whether it is there.
#pragma once

#include <optional>
#include <string>

#include "marble/server_info.h"

namespace marble::cli {

/// From the counters of two moments.
struct Rates {
  double answers_per_s = 0.0;
  std::optional<double> solved_share;  ///< of the answers; absent if there were none
  double busy_workers = 0.0;           ///< on average
  double cpu_share = 0.0;              ///< of one core; may exceed 1
};

/// Of what happened between two looks. Answers of sessions' updates count like those of jobs. Absent where
/// the counters do not belong together: no time passed, or another server answers now.
[[nodiscard]] std::optional<Rates> rates_between(const ServerInfo& earlier, const ServerInfo& later);

class ServerState {
 public:
  /// `draining`: it finishes what it has, and takes nothing more.
  void saw(const ServerInfo& info, bool draining = false);
  /// It did not answer, for this reason, at `now_s` of a steady clock.
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

}  // namespace marble::cli
