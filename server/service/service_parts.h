// The objects that the calls of all services use.
#pragma once

#include <memory>

#include "access/access.h"
#include "config/config.h"
#include "jobs/client_limit.h"
#include "jobs/job_board.h"
#include "jobs/result_store.h"
#include "jobs/scheduler.h"
#include "jobs/session_table.h"
#include "log/log.h"
#include "metrics/metrics.h"
#include "net/connection_table.h"
#include "net/live_calls.h"
#include "service/job_feed.h"

namespace marble::server {

class ServerRoster;
class Submissions;

struct ServiceParts {
  const Config& config;
  const Access& access;
  const Log& log;
  Metrics& metrics;
  Timer& timer;
  JobBoard& board;
  FeedLimit& feeds;
  ResultStore& results;
  Scheduler& scheduler;
  SessionTable& sessions;
  ConnectionTable& connections;
  LiveCalls& calls;
  Submissions* submissions = nullptr;    ///< set before the first call
  const ServerRoster* roster = nullptr;  ///< of a shared store; null without one
  /// Limits the bundles that are being made or sent.
  std::shared_ptr<ClientLimit> bundles = std::make_shared<ClientLimit>("bundles", config.bundles);
  Clock::time_point started = Clock::now();
};

}  // namespace marble::server
