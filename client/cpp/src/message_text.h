// Prepares text for a message.
#pragma once

#include <string>
#include <string_view>

#include "marble/contract.h"

namespace marble::client {

/// Returns at most `longest` bytes of `text`, cut between characters, with ? for every byte that is not
/// UTF-8: a message with such a byte cannot be parsed, and file names may contain any.
[[nodiscard]] std::string message_text(std::string_view text, std::size_t longest);

}  // namespace marble::client
