// Holds the problems of a scenario and their serialized requests, made once so that sending is cheap.
#pragma once

#include <grpcpp/support/byte_buffer.h>

#include <string>
#include <vector>

#include "scenario.h"

namespace marble::load {

struct LoadedEntry {
  Entry entry;
  Mode mode = Mode::unary;
  std::vector<OwnedProblem> problems;      ///< one per variant
  std::vector<grpc::ByteBuffer> requests;  ///< one per variant, without the sequence or tag
  grpc::ByteBuffer setup;                  ///< session: the first message
};

/// Loads every problem and builds every message. `mode` applies to entries without one.
[[nodiscard]] Expected<std::vector<LoadedEntry>> load(const Scenario& scenario, Mode mode);

/// Joins two messages of one type: protobuf merges concatenated messages.
[[nodiscard]] grpc::ByteBuffer merged(const grpc::ByteBuffer& message, const std::string& addition);

}  // namespace marble::load
