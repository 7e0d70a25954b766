#include <algorithm>
#include <cstring>

#include "handles.h"
#include "marble/version.h"

namespace marble::c {
namespace {

std::int32_t wire_code(ErrorCode code) {
  switch (code) {
#define MARBLE_ERROR(name, code, ...) \
  case ErrorCode::name:               \
    return code;
#include "marble/contract.def"
  }
  return MARBLE_INTERNAL;
}

template <std::size_t Size>
void copy(const std::string& text, char (&to)[Size]) {
  const std::size_t count = std::min(text.size(), Size - 1);
  std::memcpy(to, text.data(), count);
  to[count] = '\0';
}

}  // namespace

std::int32_t fault(const Error& reason, marble_error* error) {
  const std::int32_t code = wire_code(reason.code);
  if (error == nullptr) return code;
  *error = no_fault();
  error->code = code;
  error->index = reason.index;
  copy(reason.field, error->field);
  copy(reason.value, error->value);
  copy(reason.bound, error->bound);
  copy(reason.message(), error->message);
  return code;
}

Error null(const char* parameter) { return invalid(parameter, "must not be NULL"); }

Error in_use(const char* parameter) {
  return failure(ErrorCode::failed_precondition, parameter, "is in use by another call");
}

Expected<void> check_count(std::string field, std::int64_t count) {
  constexpr std::int64_t kMost = std::numeric_limits<Index>::max();
  if (count >= 0 && count <= kMost) return {};
  return unexpected(invalid(std::move(field), std::to_string(count),
                            count < 0 ? "must be >= 0" : "must be <= " + std::to_string(kMost)));
}

Expected<std::span<const double>> numbers(const double* values, std::int64_t count) {
  MARBLE_RETURN_IF_ERROR(check_count("count", count));
  if (values == nullptr && count > 0) return unexpected(null("values"));
  return std::span<const double>(values, static_cast<std::size_t>(count));
}

}  // namespace marble::c

std::int32_t marble_abi_version(void) { return MARBLE_ABI_VERSION; }
const char* marble_version(void) { return marble::kVersion; }

const char* marble_error_name(std::int32_t code) {
  switch (code) {
    case MARBLE_OK:
      return "ok";
#define MARBLE_ERROR(name, code, ...) \
  case code:                          \
    return #name;
#include "marble/contract.def"
    default:
      return "unknown";
  }
}

const char* marble_status_name(std::int32_t status) {
  return status < 0 ? "unknown" : to_string(static_cast<marble::Status>(status));
}

const char* marble_status_advice(std::int32_t status) {
  return status < 0 ? "" : advice(static_cast<marble::Status>(status));
}
