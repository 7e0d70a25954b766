// What the calls of all services work with.
#pragma once

#include "access.h"
#include "config.h"
#include "connection_table.h"
#include "job_board.h"
#include "job_feed.h"
#include "live_calls.h"
#include "log.h"
#include "metrics/metrics.h"
#include "result_store.h"
#include "scheduler.h"
#include "session_table.h"

namespace marble::server {

struct ServiceParts {
  const Config& config;
  const Access& access;
  const Log& log;
  Metrics& metrics;
  Pulse& pulse;
  JobBoard& board;
  FeedLimit& feeds;
  ResultStore& results;
  Scheduler& scheduler;
  SessionTable& sessions;
  ConnectionTable& connections;
  LiveCalls& calls;
  Clock::time_point started = Clock::now();
};

}  // namespace marble::server
