// What every call of the solver service works with.
#pragma once

#include "live_calls.h"
#include "log.h"
#include "scheduler.h"

namespace marble::server {

struct ServiceParts {
  Scheduler& scheduler;
  const Log& log;
  LiveCalls& calls;
};

}  // namespace marble::server
