#include "request.h"

#include <algorithm>
#include <limits>

#include "marble/convert.h"
#include "message_text.h"

namespace marble::client {
namespace {

constexpr std::size_t kLongestRequestId = 128;

bool printable_ascii(char c) { return c >= ' ' && c <= '~'; }

}  // namespace

Expected<v1::SolveStreamRequest> make_request(const ProblemView& problem, const Options& options,
                                              const SolveControls& controls, const CallControls& call) {
  const std::string& id = call.request_id;
  if (id.size() > kLongestRequestId || !std::all_of(id.begin(), id.end(), printable_ascii)) {
    return unexpected(Error{ErrorCode::invalid_argument, "request_id", -1, "",
                            "must be at most 128 bytes of printable ASCII"});
  }
  v1::SolveStreamRequest request;
  v1::SolveRequest* solve = request.mutable_solve();
  to_message(problem, solve->mutable_problem());
  solve->mutable_problem()->set_name(message_text(call.problem_name, kLongestName));
  to_message(options, solve->mutable_options());
  solve->mutable_initial_point()->mutable_z()->Assign(controls.initial_z.begin(), controls.initial_z.end());
  solve->set_request_id(id);
  request.set_progress_interval_s(call.progress_interval_s);
  request.set_iterate_every(call.iterate_every);
  const std::size_t bytes = request.ByteSizeLong();
  if (bytes > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
    return unexpected(Error{ErrorCode::resource_exhausted, "problem", -1, std::to_string(bytes) + " bytes",
                            "must be less than 2 GiB in all"});
  }
  return request;
}

}  // namespace marble::client
