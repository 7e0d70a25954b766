// A server without a port and without room for a job: all that calls share.
#pragma once

#include <memory>

#include "service/service_parts.h"
#include "submissions/local_submissions.h"

namespace marble::server {

struct IdleParts {
  IdleParts() { all.submissions = submissions.get(); }

  Config config;
  Log log{"text", "off", 1 << 20};
  Access access{config};
  Metrics metrics{true, 10};
  LiveCalls calls;
  JobBoard board{{10, 10, 10}};
  FeedLimit feeds{10};
  ResultStore results{{std::chrono::seconds(10), 1000}};
  SessionTable sessions{{10, 1000}};
  ConnectionTable connections{{}, log};
  Scheduler scheduler{{1, 10, 0, 10}, board, log, metrics};
  Pulse pulse;
  ServiceParts all{config, access,  log,       metrics,  pulse,       board,
                   feeds,  results, scheduler, sessions, connections, calls};
  const std::unique_ptr<Submissions> submissions = LocalSubmissions::begin(all, nullptr).value();
};

}  // namespace marble::server
