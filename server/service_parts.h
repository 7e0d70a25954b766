// What the calls of all services work with.
#pragma once

#include "access.h"
#include "config.h"
#include "job_board.h"
#include "live_calls.h"
#include "log.h"
#include "result_store.h"
#include "scheduler.h"
#include "session_table.h"

namespace marble::server {

struct ServiceParts {
  const Config& config;
  const Access& access;
  const Log& log;
  Pulse& pulse;
  JobBoard& board;
  ResultStore& results;
  Scheduler& scheduler;
  SessionTable& sessions;
  LiveCalls& calls;
};

}  // namespace marble::server
