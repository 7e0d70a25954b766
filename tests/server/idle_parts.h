// A server without a port and without room for a job: all that calls share.
#pragma once

#include "service/service_parts.h"

namespace marble::server {

struct IdleParts {
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
  const ServiceParts all{config,  access,  log,       metrics,  pulse,       board, feeds,
                         results, nullptr, scheduler, sessions, connections, calls};
};

}  // namespace marble::server
