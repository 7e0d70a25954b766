#include "store/array_source.h"

#include "base/status.h"

namespace marble::server {

v1::ArrayResultsResponse message_of(const ElementAnswer& answer) {
  v1::ArrayResultsResponse message;
  if (!message.ParseFromString(answer.message) ||
      message.outcome_case() == v1::ArrayResultsResponse::OUTCOME_NOT_SET) {
    message.Clear();
    message.set_index(answer.index);
    *message.mutable_error() = to_message(failure(ErrorCode::internal, "the stored answer cannot be read"));
  }
  message.set_sequence(answer.sequence);
  return message;
}

}  // namespace marble::server
