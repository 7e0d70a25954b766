// Builds the request of a solve.
#pragma once

#include "marble/call_controls.h"
#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/solver.h"
#include "marble/v1/service.pb.h"

namespace marble::client {

/// The part that all kinds of solves share.
struct RequestParts {
  const ProblemView& problem;
  const Options& options;
  std::span<const double> initial_z;
  const Solution* warm_start;             // or null
  const SensitivityRequest* sensitivity;  // or null
  const std::string& request_id;
  const std::string& problem_name;
  Priority priority;
};

/// Copies everything into the message. Errors: request_id is not printable ASCII of at most 128 bytes, the
/// whole is larger than protobuf's 2 GiB.
[[nodiscard]] Expected<void> fill_request(const RequestParts& parts, v1::SolveRequest* request);

/// The same with a stream's settings for events.
[[nodiscard]] Expected<v1::SolveStreamRequest> make_request(const ProblemView& problem,
                                                            const Options& options,
                                                            const SolveControls& controls,
                                                            const CallControls& call);

[[nodiscard]] Expected<void> check_request_id(const std::string& id);
/// Checks that protobuf can serialize it: less than 2 GiB.
[[nodiscard]] Expected<void> check_size(const google::protobuf::Message& message);

[[nodiscard]] v1::Priority to_message(Priority priority);

}  // namespace marble::client
