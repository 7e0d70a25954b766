// Changes a message here and there, so that most of what comes out is still nearly what a server takes.
#pragma once

#include <google/protobuf/message.h>

#include <cstdint>

#include "requests/draw.h"

namespace marble::fuzz {

/// One field of it or of a message within: another number of its kind, an entry more or less, absent, there.
void mutate(google::protobuf::Message& message, Draw& draw);

/// The body of a LLVMFuzzerCustomMutator: the bytes' message changed, or now and then `make(draw)`.
template <class Message, class Make>
std::size_t mutate_bytes(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed,
                         const Make& make) {
  Draw draw(seed);
  Message message;
  if (draw.chance(25) || size == 0 || !message.ParseFromArray(data, static_cast<int>(size))) {
    message = make(draw);
  } else {
    for (int times = draw.chance(70) ? 1 : 3; times > 0; --times) mutate(message, draw);
  }
  if (message.ByteSizeLong() > most) message = make(draw);
  if (message.ByteSizeLong() > most) return 0;
  message.SerializeToArray(data, static_cast<int>(most));
  return message.ByteSizeLong();
}

}  // namespace marble::fuzz
