#include "marble/error.h"

#include <utility>

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

Error failure(ErrorCode code, std::string bound) { return failure(code, {}, {}, std::move(bound)); }

Error failure(ErrorCode code, std::string field, std::string value, std::string bound) {
  return {code, std::move(field), -1, std::move(value), std::move(bound)};
}

Error failure(ErrorCode code, std::string field, std::string bound) {
  return failure(code, std::move(field), {}, std::move(bound));
}

Error invalid(std::string field, std::string bound) {
  return invalid(std::move(field), {}, std::move(bound));
}

Error invalid(std::string field, std::string value, std::string bound) {
  return invalid(std::move(field), -1, std::move(value), std::move(bound));
}

Error invalid(std::string field, std::int64_t index, std::string value, std::string bound) {
  return {ErrorCode::invalid_argument, std::move(field), index, std::move(value), std::move(bound)};
}

Error inside(std::string_view prefix, Error error) {
  if (!error.field.empty()) error.field.insert(0, std::string(prefix) + ".");
  return error;
}

Error of_field(std::string field, Error error) {
  error.field = std::move(field);
  return error;
}

Error out_of_memory() { return failure(ErrorCode::resource_exhausted, "this process is out of memory"); }

}  // namespace marble
