// Provides the table of jobs: their data and their display order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <unordered_map>
#include <vector>

#include "marble/jobs.h"
#include "watch/thinned.h"

namespace marble::cli {

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

}  // namespace marble::cli
