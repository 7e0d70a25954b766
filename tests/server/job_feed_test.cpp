// What a feed of one job says of its end, while the job ends.
#include "service/job_feed.h"

#include <gtest/gtest.h>

#include <thread>

namespace marble::server {
namespace {

TEST(JobFeed, TellsTheEndOfAJobOnceWheneverItEnds) {
  JobBoard board({});
  FeedLimit limit(10);
  const Identity viewer{"client", {}};
  for (int round = 0; round < 3000; ++round) {
    const std::string id = "job" + std::to_string(round);
    const auto record = board.make({.id = id, .client = viewer.client}, {});
    board.add(record);
    record->queued();
    record->started(0.0);
    v1::WatchJobsRequest request;
    request.set_job_id(id);
    const auto feed = JobFeed::open(board, limit, viewer, {}, request).value();
    std::jthread solver([&] {
      Progress progress;
      for (progress.iteration = 0; progress.iteration < 5; ++progress.iteration) record->report(progress);
      record->finished(Solution(), 0.0, 0.0);
    });
    int finished = 0;
    for (bool ended = false; !ended || finished == 0;) {
      ended = record->is_finished();
      v1::WatchJobsResponse response;
      if (!feed->next(&response)) continue;
      ASSERT_EQ(response.events_size(), 1);
      finished += response.events(0).job().state() == v1::JOB_STATE_FINISHED ? 1 : 0;
      ASSERT_EQ(feed->is_over(), finished > 0) << "the stream goes on after its last event";
    }
    v1::WatchJobsResponse more;
    EXPECT_FALSE(feed->next(&more));
    ASSERT_EQ(finished, 1);
  }
}

}  // namespace
}  // namespace marble::server
