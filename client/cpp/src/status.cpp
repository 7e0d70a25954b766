#include "status.h"

#include <charconv>
#include <string_view>

#include "google/rpc/error_details.pb.h"
#include "marble/contract.h"
#include "marble/convert.h"

namespace marble::client {
namespace {

// "solve.problem.equality_matrix.values[3]" → field "A.values", index 3.
void take_field(std::string path, Error& error) {
  for (const std::string_view prefix : {"solve.", "setup.", "update.", "problem.", "options."}) {
    if (path.rfind(prefix, 0) == 0) path.erase(0, prefix.size());
  }
  if (!path.empty() && path.back() == ']') {
    const std::size_t open = path.rfind('[');
    if (open != std::string::npos) {
      std::from_chars(path.data() + open + 1, path.data() + path.size() - 1, error.index);
      path.erase(open);
    }
  }
  error.field = path == "initial_point.z" ? "initial_z" : core_field(path);
}

// "is 12, must be in [0, 12)" → value and bound.
void take_description(const std::string& description, Error& error) {
  const std::size_t comma = description.find(", ");
  if (description.rfind("is ", 0) == 0 && comma != std::string::npos) {
    error.value = description.substr(3, comma - 3);
    error.bound = description.substr(comma + 2);
  } else {
    error.bound = description;
  }
}

}  // namespace

Error to_error(const grpc::Status& status) {
  google::rpc::Status details;
  // An intermediary's status has no details of ours.
  if (!details.ParseFromString(status.error_details())) details.clear_details();
  details.set_code(status.error_code());
  details.set_message(status.error_message());
  return to_error(details);
}

Error to_error(const google::rpc::Status& status) {
  Error error;
  error.code = error_code_of(status.code());
  error.bound = status.message();
  if (error.code == ErrorCode::unavailable &&
      error.bound.find(contract::default_address) != std::string::npos)
    error.bound += std::string(contract::no_server_hint) + contract::local_hint;
  for (const auto& any : status.details()) {
    google::rpc::BadRequest bad_request;
    if (!any.UnpackTo(&bad_request) || bad_request.field_violations().empty()) continue;
    take_field(bad_request.field_violations(0).field(), error);
    take_description(bad_request.field_violations(0).description(), error);
  }
  return error;
}

Error to_error(const grpc::Status& status, const std::stop_token& stop) {
  Error error = to_error(status);
  if (error.code == ErrorCode::cancelled && stop.stop_requested()) error.bound = "cancelled by the caller";
  return error;
}

Error out_of_memory() { return {ErrorCode::resource_exhausted, "", -1, "", "this process is out of memory"}; }

}  // namespace marble::client
