#include "marble/error.h"

namespace marble {

const char* to_string(ErrorCode code) {
  switch (code) {
#define MARBLE_ERROR(name, ...) \
  case ErrorCode::name:         \
    return #name;
#include "marble/contract.def"
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
