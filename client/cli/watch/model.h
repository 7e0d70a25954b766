// Provides the data of the live view, as the server reports it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "marble/jobs.h"
#include "marble/server_info.h"

namespace marble::cli {

// Provides a history of bounded length over any duration.

/// Keeps the first value, the newest, and evenly spaced ones between: when there are `kMost`, every second
/// one is removed, and from then on only every second new one is kept.
template <class T, std::size_t kMost>
class Thinned {
  static_assert(kMost >= 4 && kMost % 2 == 0);

 public:
  void add(const T& value) {
    if (newest_only_) values_.pop_back();
    if (values_.size() == kMost) halve();
    newest_only_ = count_ % stride_ != 0;
    values_.push_back(value);
    ++count_;
  }
  /// Oldest first; at most kMost + 1.
  [[nodiscard]] std::span<const T> values() const { return values_; }
  [[nodiscard]] std::size_t stride() const { return stride_; }

 private:
  void halve() {
    for (std::size_t i = 0; 2 * i < values_.size(); ++i) values_[i] = values_[2 * i];
    values_.resize(kMost / 2);
    stride_ *= 2;
  }

  std::vector<T> values_;
  std::size_t stride_ = 1, count_ = 0;
  bool newest_only_ = false;  // the last value is only kept as the newest, and is replaced by the next
};

// Provides the table of jobs: their data and their display order.

/// The sort key of rows. `activity`: running ones, then waiting ones in queue order, then open sessions, then
/// finished ones, newest first.
enum class SortBy { activity, age, client, problem, size, priority, state, iterations, time, violation };
inline constexpr int kSortBys = static_cast<int>(SortBy::violation) + 1;
[[nodiscard]] const char* to_string(SortBy by);

/// The user's choice of what the table shows.
struct TableView {
  SortBy by = SortBy::activity;
  bool reversed = false;
  std::string filter = {};  ///< only rows with this text in id, client, problem, state, status or priority
};

struct JobRow {
  JobInfo job;
  Thinned<double, 64> violations;  ///< the largest violation over time
  std::int64_t reported_iterations = 0;
};

class JobTable {
 public:
  static constexpr std::size_t kMostFinished = 1000;

  /// Replaces the table by a list, newest first: other jobs are removed.
  void replace(const std::vector<JobInfo>& jobs);
  void update(const JobInfo& job);

  /// Returns null if the job is unknown.
  [[nodiscard]] const JobRow* find(const std::string& job_id) const;
  /// Valid until the table changes.
  [[nodiscard]] std::vector<const JobRow*> rows(const TableView& view) const;
  [[nodiscard]] std::size_t size() const { return rows_.size(); }

 private:
  void forget_old();

  std::unordered_map<std::string, JobRow> rows_;
  std::deque<std::string> finished_;  // in the order of the reports
};

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
