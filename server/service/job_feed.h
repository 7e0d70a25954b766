// What has happened to one job or to all since somebody last asked: the source of Jobs.Watch and of the page.
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

/// How many feeds there are, and may be.
class FeedLimit : public ClientLimit {
 public:
  explicit FeedLimit(int most) : ClientLimit("watchers", most) {}
};

/// Looks at the jobs' records when it is asked: a slow reader costs nothing but what it misses. One thread
/// at a time.
class JobFeed {
 public:
  /// For what the request names and the viewer may see, from now on. Errors: invalid_argument, not_found,
  /// resource_exhausted (too many feeds, of all or of the viewer's).
  [[nodiscard]] static Expected<std::unique_ptr<JobFeed>> open(const JobBoard& board, FeedLimit& limit,
                                                               const Identity& viewer, const Quota& quota,
                                                               const v1::WatchJobsRequest& request);
  ~JobFeed();
  JobFeed(const JobFeed&) = delete;
  JobFeed& operator=(const JobFeed&) = delete;

  /// False if there is nothing to tell.
  [[nodiscard]] bool next(v1::WatchJobsResponse* response);
  /// More is to tell at once.
  [[nodiscard]] bool has_more() const { return !to_tell_.empty(); }
  /// The one job has finished, and all was told.
  [[nodiscard]] bool is_over() const { return over_; }

 private:
  JobFeed(const JobBoard& board, FeedLimit& limit, Identity viewer, double interval_s)
      : board_(board), limit_(limit), viewer_(std::move(viewer)), interval_s_(interval_s) {}
  [[nodiscard]] bool next_of_one(v1::WatchJobsResponse* response);
  [[nodiscard]] bool next_of_all(v1::WatchJobsResponse* response);
  void look_around();
  void renew_active();

  // Of a job: what was told of it, and when.
  struct Told {
    std::int64_t changes = -1, version = -1;
    Clock::time_point at = {};
  };

  const JobBoard& board_;
  FeedLimit& limit_;
  const Identity viewer_;
  const double interval_s_;
  std::shared_ptr<JobRecord> one_;  // null: all
  Told told_;                       // of one
  std::int64_t cursor_ = 0;
  JobBoard::Records active_;   // those that were active at the last look
  std::vector<Told> told_of_;  // of each of them
  struct News {
    std::shared_ptr<JobRecord> record;
    bool last = false;  // it was found among the finished ones
  };
  std::deque<News> to_tell_;
  std::int64_t finished_ = 0;  // cursor of the board
  std::int64_t skipped_ = 0;
  bool over_ = false;
};

}  // namespace marble::server
