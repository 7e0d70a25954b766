#include "message/request.h"

#include <limits>

#include "marble/convert.h"
#include "message_text.h"

namespace marble::client {

Expected<void> check_request_id(const std::string& id) {
  if (id.size() <= contract::longest_request_id && is_printable(id)) return {};
  return unexpected(invalid("request_id", "must be at most " + std::to_string(contract::longest_request_id) +
                                              " bytes of printable ASCII"));
}

Expected<void> check_size(const google::protobuf::Message& message) {
  const std::size_t bytes = message.ByteSizeLong();
  if (bytes <= static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) return {};
  return unexpected(failure(ErrorCode::resource_exhausted, "problem", std::to_string(bytes) + " bytes",
                            "must be less than 2 GiB in all"));
}

static_assert(static_cast<int>(Priority::by_method) == v1::PRIORITY_UNSPECIFIED &&
                  static_cast<int>(Priority::batch) == v1::PRIORITY_BATCH,
              "the enums count alike");

v1::Priority to_message(Priority priority) { return static_cast<v1::Priority>(static_cast<int>(priority)); }

Expected<void> fill_request(const RequestParts& parts, v1::SolveRequest* request) {
  MARBLE_RETURN_IF_ERROR(check_request_id(parts.request_id));
  marble::to_message(parts.problem, request->mutable_problem());
  request->mutable_problem()->set_name(message_text(parts.problem_name, contract::longest_problem_name));
  marble::to_message(parts.options, request->mutable_options());
  request->mutable_initial_point()->mutable_z()->Assign(parts.initial_z.begin(), parts.initial_z.end());
  if (parts.warm_start != nullptr) marble::to_message(*parts.warm_start, request->mutable_warm_start());
  if (parts.sensitivity != nullptr) marble::to_message(*parts.sensitivity, request->mutable_sensitivity());
  request->set_request_id(parts.request_id);
  request->set_priority(to_message(parts.priority));
  return check_size(*request);
}

Expected<v1::SolveStreamRequest> make_request(const ProblemView& problem, const Options& options,
                                              const SolveControls& controls, const CallControls& call) {
  v1::SolveStreamRequest request;
  const RequestParts parts{
      problem,         options,           controls.initial_z, controls.warm_start, controls.sensitivity,
      call.request_id, call.problem_name, call.priority};
  MARBLE_RETURN_IF_ERROR(fill_request(parts, request.mutable_solve()));
  request.set_progress_interval_s(call.progress_interval_s);
  request.set_iterate_every(call.iterate_every);
  MARBLE_RETURN_IF_ERROR(check_size(request));
  return request;
}

}  // namespace marble::client
