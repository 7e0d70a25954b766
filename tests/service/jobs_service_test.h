// What tests of jobs share: Jobs' methods as calls, on a server of the test's own.
#pragma once

#include <string>
#include <vector>

#include "jobs_client.h"

namespace marble::testing {

class JobsServiceTest : public ServiceTest, protected JobsClient {
 protected:
  void start(const std::vector<std::string>& flags = {}) {
    ServiceTest::start(flags);
    static_cast<JobsClient&>(*this) = JobsClient(channel());
  }
};

}  // namespace marble::testing
