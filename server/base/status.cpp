#include "base/status.h"

#include <google/protobuf/stubs/common.h>

#include <cmath>

#include "google/rpc/error_details.pb.h"
#include "marble/convert.h"
#include "marble/v1/fault.pb.h"

namespace marble::server {
namespace {

constexpr std::size_t kLongestValue = 64;  // bytes of an error's value that are sent

}  // namespace

// A name in a certificate or in a damaged store may contain any bytes, and a single string that is not UTF-8
// makes the whole message unreadable.
std::string utf8(const std::string& text) {
  if (google::protobuf::internal::IsStructurallyValidUTF8(text.data(), static_cast<int>(text.size())))
    return text;
  std::string valid(text.size(), '\0');
  valid.assign(google::protobuf::internal::UTF8CoerceToStructurallyValid(text, valid.data(), '?'),
               text.size());
  return valid;
}

bool retry_may_help(ErrorCode code) {
  switch (code) {
#define MARBLE_ERROR(name, code, exit, retry, ...) \
  case ErrorCode::name:                            \
    return retry;
#include "marble/contract.def"
  }
  return false;
}

Error abridged(Error error) {
  if (error.value.size() <= kLongestValue) return error;
  const std::size_t bytes = error.value.size();
  std::size_t end = kLongestValue;
  while (end > 0 && (static_cast<unsigned char>(error.value[end]) & 0xC0U) == 0x80U) --end;  // within UTF-8
  error.value.resize(end);
  error.value += "... (" + std::to_string(bytes) + " bytes)";
  return error;
}

google::rpc::Status to_message(const Error& whole, double retry_delay_s) {
  Error error = abridged(whole);
  for (std::string* text : {&error.field, &error.value, &error.bound}) *text = utf8(*text);
  google::rpc::Status details;
  details.set_code(marble::to_message(error.code));
  details.set_message(error.message());
  if (error.code == ErrorCode::invalid_argument) {
    google::rpc::BadRequest bad_request;
    auto* violation = bad_request.add_field_violations();
    violation->set_field(error.index < 0 ? error.field
                                         : error.field + "[" + std::to_string(error.index) + "]");
    violation->set_description(error.value.empty() ? error.bound : "is " + error.value + ", " + error.bound);
    details.add_details()->PackFrom(bad_request);
  }
  if (!error.field.empty()) {
    v1::Fault fault;
    fault.set_field(error.field);
    if (error.index >= 0) fault.set_index(error.index);
    fault.set_value(error.value);
    fault.set_bound(error.bound);
    details.add_details()->PackFrom(fault);
  }
  if (retry_may_help(error.code) && retry_delay_s > 0.0) {
    google::rpc::RetryInfo retry;
    retry.mutable_retry_delay()->set_seconds(static_cast<std::int64_t>(retry_delay_s));
    retry.mutable_retry_delay()->set_nanos(
        static_cast<std::int32_t>(1e9 * (retry_delay_s - std::floor(retry_delay_s))));
    details.add_details()->PackFrom(retry);
  }
  return details;
}

Error error_of(const google::rpc::Status& status) {
  Error error;
  error.code = error_code_of(status.code());
  error.bound = status.message();
  for (const auto& any : status.details()) {
    v1::Fault fault;
    if (!any.UnpackTo(&fault)) continue;
    error.field = fault.field();
    error.index = fault.has_index() ? fault.index() : -1;
    error.value = fault.value();
    error.bound = fault.bound();
  }
  return error;
}

grpc::Status to_status(const Error& error, double retry_delay_s) {
  const google::rpc::Status details = to_message(error, retry_delay_s);
  return {static_cast<grpc::StatusCode>(details.code()), details.message(), details.SerializeAsString()};
}

}  // namespace marble::server
