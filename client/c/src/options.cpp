#include "handles.h"

using marble::Expected;
using marble::unexpected;
using marble::c::guarded;
using marble::c::null;

std::int32_t marble_options_create(marble_options** options, marble_error* error) {
  if (options != nullptr) *options = nullptr;
  return guarded(error, [&]() -> Expected<void> {
    if (options == nullptr) return unexpected(null("options"));
    *options = new marble_options();
    return {};
  });
}

void marble_options_destroy(marble_options* options) { delete options; }

std::int32_t marble_options_set(marble_options* options, const char* name, const char* text,
                                marble_error* error) {
  return guarded(error, [&]() -> Expected<void> {
    if (options == nullptr) return unexpected(null("options"));
    if (name == nullptr) return unexpected(null("name"));
    if (text == nullptr) return unexpected(null("text"));
    return marble::set_option_text(options->options, name, text);
  });
}

std::int32_t marble_options_set_number(marble_options* options, const char* name, double value,
                                       marble_error* error) {
  return guarded(error, [&]() -> Expected<void> {
    if (options == nullptr) return unexpected(null("options"));
    if (name == nullptr) return unexpected(null("name"));
    return marble::set_option(options->options, name, value);
  });
}

std::int32_t marble_options_get(const marble_options* options, const char* name, double* value,
                                marble_error* error) {
  return guarded(error, [&]() -> Expected<void> {
    if (options == nullptr) return unexpected(null("options"));
    if (name == nullptr) return unexpected(null("name"));
    if (value == nullptr) return unexpected(null("value"));
    for (const marble::OptionInfo& info : marble::option_table()) {
      if (info.name != name) continue;
      *value = marble::get_option(options->options, name);
      return {};
    }
    return unexpected(marble::invalid(name, "is not an option"));
  });
}
