#include "marble/error.h"

namespace marble {

const char* to_string(ErrorCode code) {
  switch (code) {
    case ErrorCode::invalid_argument:
      return "invalid_argument";
    case ErrorCode::failed_precondition:
      return "failed_precondition";
    case ErrorCode::resource_exhausted:
      return "resource_exhausted";
    case ErrorCode::not_found:
      return "not_found";
    case ErrorCode::unavailable:
      return "unavailable";
    case ErrorCode::cancelled:
      return "cancelled";
    case ErrorCode::deadline_exceeded:
      return "deadline_exceeded";
    case ErrorCode::permission_denied:
      return "permission_denied";
    case ErrorCode::unauthenticated:
      return "unauthenticated";
    case ErrorCode::aborted:
      return "aborted";
    case ErrorCode::internal:
      return "internal";
  }
  return "unknown";
}

std::string Error::message() const {
  std::string text = field;
  if (index >= 0) text.append("[").append(std::to_string(index)).append("]");
  if (!value.empty()) text.append(text.empty() ? "" : " = ").append(value);
  if (!bound.empty()) text.append(text.empty() ? "" : ": ").append(bound);
  return text.empty() ? to_string(code) : text;
}

}  // namespace marble
