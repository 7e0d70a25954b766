// Describes a pressed key.
#pragma once

#include <string>

namespace marble::cli {

enum class KeyName { text, up, down, page_up, page_down, home, end, enter, escape, backspace };

struct Key {
  KeyName name = KeyName::text;
  std::string text = {};  ///< for KeyName::text: one character, UTF-8
};

}  // namespace marble::cli
