#include "connection/service_config.h"

#include <nlohmann/json.hpp>

namespace marble::client {

std::string service_config(bool several) {
  nlohmann::json names = nlohmann::json::array();
  const auto add = [&](const char* service, std::initializer_list<const char*> methods) {
    for (const char* method : methods)
      names.push_back({{"service", std::string("marble.v1.") + service}, {"method", method}});
  };
  add("Solver", {"Solve", "SolveStream", "SolveScenarios", "SolveCoupled"});
  add("Jobs", {"Submit", "Result", "List", "Get", "Watch", "Bundle", "SubmitArray", "ArrayResults"});
  add("Server", {"GetInfo"});
  nlohmann::json config = {{"methodConfig",
                            {{{"name", names},
                              {"retryPolicy",
                               {{"maxAttempts", 4},
                                {"initialBackoff", "0.1s"},
                                {"maxBackoff", "1s"},
                                {"backoffMultiplier", 2},
                                {"retryableStatusCodes", {"UNAVAILABLE"}}}}}}}};
  if (several) {
    config["loadBalancingConfig"] = {{{"round_robin", nlohmann::json::object()}}};
    config["healthCheckConfig"] = {{"serviceName", "marble.v1.Solver"}};
  }
  return config.dump();
}

}  // namespace marble::client
