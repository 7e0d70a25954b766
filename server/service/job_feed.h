// Reports what has happened to one job or to all jobs since the last request: the source of Jobs.Watch and
// of the page.
#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "base/identity.h"
#include "base/quota.h"
#include "jobs/client_limit.h"
#include "jobs/job_board.h"
#include "marble/v1/job.pb.h"

namespace marble::server {

/// Counts the open feeds and limits their number.
class FeedLimit : public ClientLimit {
 public:
  explicit FeedLimit(int most) : ClientLimit("watchers", most) {}
};

/// Reads the jobs' records when it is asked, so a slow reader costs nothing and only misses events. Used by
/// one thread at a time.
class JobFeed {
 public:
  /// Opens a feed of what the request names and the viewer may see, from now on. Errors: invalid_argument,
  /// not_found, resource_exhausted (too many feeds, in total or of the viewer).
  [[nodiscard]] static Expected<std::unique_ptr<JobFeed>> open(const JobBoard& board, FeedLimit& limit,
                                                               const Identity& viewer, const Quota& quota,
                                                               const v1::WatchJobsRequest& request);
  ~JobFeed();
  JobFeed(const JobFeed&) = delete;
  JobFeed& operator=(const JobFeed&) = delete;

  /// False if there is nothing to report.
  [[nodiscard]] bool next(v1::WatchJobsResponse* response);
  /// True if more can be reported at once.
  [[nodiscard]] bool has_more() const { return !to_report_.empty(); }
  /// True if the one job has finished and everything has been reported.
  [[nodiscard]] bool is_over() const { return over_; }

 private:
  JobFeed(const JobBoard& board, FeedLimit& limit, Identity viewer, double interval_s)
      : board_(board), limit_(limit), viewer_(std::move(viewer)), interval_s_(interval_s) {}
  [[nodiscard]] bool next_of_one(v1::WatchJobsResponse* response);
  [[nodiscard]] bool next_of_all(v1::WatchJobsResponse* response);
  void look_around();
  void renew_active();

  // What was reported of a job, and when.
  struct Reported {
    std::int64_t changes = -1, version = -1;
    Clock::time_point at = {};
  };

  const JobBoard& board_;
  FeedLimit& limit_;
  const Identity viewer_;
  const double interval_s_;
  std::shared_ptr<JobRecord> one_;  // null: all jobs
  Reported reported_;               // state of the one job
  std::int64_t cursor_ = 0;
  JobBoard::Records active_;           // the jobs that were active at the last refresh
  std::vector<Reported> reported_of_;  // state of each of them
  struct News {
    std::shared_ptr<JobRecord> record;
    bool last = false;  // the job was found among the finished ones
  };
  std::deque<News> to_report_;
  std::int64_t finished_ = 0;  // cursor into the board
  std::int64_t skipped_ = 0;
  bool over_ = false;
};

}  // namespace marble::server
