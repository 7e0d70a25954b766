// A server without ports that does in the calling thread what its workers would, with small budgets: counts,
// never times, so that an input comes to the same end every time.
#pragma once

#include <memory>
#include <optional>

#include "../server/idle_parts.h"
#include "marble/v1/service.pb.h"
#include "service/admission.h"

namespace marble::fuzz {

/// Limits that small requests stay within, and others meet.
struct SmallParts : server::IdleParts {
  /// As IdleParts has them.
  explicit SmallParts(std::int64_t queue_bytes = 0, std::int64_t result_bytes = 1000);
};

/// What may take long takes little: iterations, searches, trees. What is no valid option stays as it is.
void limit_budgets(v1::SolveOptions* options);
void limit_budgets(v1::SolveRequest* request);

/// Who calls, with every role.
[[nodiscard]] server::Caller any_caller();

/// A request through admission and its work.
struct Done {
  std::shared_ptr<server::Job> job;
  v1::Solution answer;  ///< as a client reads it
};
/// Nothing where it is refused, or its work is, with an error that is sound.
[[nodiscard]] std::optional<Done> solve(const server::ServiceParts& parts, server::JobKind kind,
                                        std::shared_ptr<const v1::SolveRequest> request);

}  // namespace marble::fuzz
