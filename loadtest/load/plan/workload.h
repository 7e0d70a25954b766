// The problems of a scenario, and the bytes that ask for them: made once, so that sending costs little.
#pragma once

#include <grpcpp/support/byte_buffer.h>

#include <string>
#include <vector>

#include "plan/scenario.h"

namespace marble::load {

struct LoadedEntry {
  Entry entry;
  Mode mode = Mode::unary;
  std::vector<OwnedProblem> problems;      ///< one a variant
  std::vector<grpc::ByteBuffer> requests;  ///< one a variant, but for the sequence or tag
  grpc::ByteBuffer setup;                  ///< session: what comes first
};

/// Loads every problem and makes every message. `mode` is that of entries without one.
[[nodiscard]] Expected<std::vector<LoadedEntry>> load(const Scenario& scenario, Mode mode);

/// Two messages of one type as one: protobuf merges what follows one another.
[[nodiscard]] grpc::ByteBuffer merged(const grpc::ByteBuffer& message, const std::string& addition);

}  // namespace marble::load
