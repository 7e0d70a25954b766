// What calls share, without a port. Without `queue_bytes` there is no room for a job.
#pragma once

#include <memory>

#include "service/service_parts.h"
#include "submissions/local_submissions.h"

namespace marble::server {

struct IdleParts {
  /// `queue_bytes`: of the jobs that may wait or run.
  explicit IdleParts(std::int64_t queue_bytes = 0, std::int64_t result_bytes = 1000)
      : results{{std::chrono::seconds(10), result_bytes}},
        scheduler{{.workers = 1, .jobs = 10, .bytes = queue_bytes}, board, log, metrics} {
    all.submissions = submissions.get();
  }

  Config config;
  Log log{"text", "off", 1 << 20};
  Access access{config};
  Metrics metrics{true, 10};
  LiveCalls calls;
  JobBoard board{{10, 10, 10}};
  FeedLimit feeds{10};
  ResultStore results;
  SessionTable sessions{{10, 1000}};
  ConnectionTable connections{{}, log};
  Scheduler scheduler;
  Timer timer;
  ServiceParts all{config, access,  log,       metrics,  timer,       board,
                   feeds,  results, scheduler, sessions, connections, calls};
  const std::unique_ptr<Submissions> submissions = LocalSubmissions::begin(all, nullptr).value();
};

}  // namespace marble::server
