// Two updates of a session as bytes, the second of which takes the first along: what the checks let through
// the solver takes, and both together are no larger than one may be. The first byte says where the second
// message begins.
#include "calls/session_update.h"

#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <cstdint>
#include <optional>

#include "expect.h"
#include "marble/convert.h"
#include "marble/warm_solver.h"

namespace {

using namespace marble;
using server::Update;

// min ½ z'z  s.t.  z0 + z1 = 1,  z2 ≤ 2,  0 ≤ z0 ⊥ z3 ≥ 0: every part of an update has something to change.
OwnedProblem small_problem() {
  OwnedProblem p;
  p.Q = {4, 4, {0, 1, 2, 3, 4}, {0, 1, 2, 3}, {1, 1, 1, 1}};
  p.g = {-1, -1, -3, -1};
  p.A = {1, 4, {0, 1, 2, 2, 2}, {0, 0}, {1, 1}}, p.b = {-1};
  p.C = {1, 4, {0, 0, 0, 1, 1}, {0}, {-1}}, p.d = {2};
  p.L = {1, 4, {0, 1, 1, 1, 1}, {0}, {1}}, p.l = {0};
  p.R = {1, 4, {0, 0, 0, 0, 1}, {0}, {1}}, p.r = {0};
  return p;
}

Options few_iterations() {
  Options few;
  few.max_iterations = 4;
  few.max_local_search_factorizations = 0;
  return few;
}

std::optional<Update> read(const std::uint8_t* data, std::size_t size, const PartSizes& sizes) {
  const grpc::Slice slice(data, size);
  grpc::ByteBuffer bytes(&slice, 1);
  v1::SessionRequest request;
  if (const auto parsed = server::parse_update(bytes, sizes, &request); !parsed) {
    FUZZ_EXPECT(!parsed.error().message().empty());
    return std::nullopt;
  }
  if (!request.has_update()) return std::nullopt;
  auto update = Update::check(*request.mutable_update(), sizes, few_iterations());
  if (update) return std::move(*update);
  FUZZ_EXPECT(update.error().field.starts_with("update."));
  return std::nullopt;
}

void apply(WarmSolver& solver, const Update& update) {
  FUZZ_EXPECT(solver.solve(update.checked()).has_value());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const google::protobuf::LogSilencer silence;
  static const OwnedProblem owned = small_problem();
  static const Problem problem = Problem::create(owned.view()).value();
  static const PartSizes sizes = PartSizes::of(problem);
  if (size == 0) return 0;
  const std::size_t first = std::min<std::size_t>(data[0], size - 1);
  const std::optional<Update> older = read(data + 1, first, sizes);
  std::optional<Update> newer = read(data + 1 + first, size - 1 - first, sizes);
  if (!older || !newer) return 0;
  auto solver = WarmSolver::create(problem, few_iterations());
  FUZZ_EXPECT(solver.has_value());
  apply(*solver, *older);
  newer->take_along(*older);
  FUZZ_EXPECT(newer->bytes() <= server::most_update_bytes(sizes));
  const CheckedUpdate both = newer->checked();
  FUZZ_EXPECT(CheckedUpdate::check(sizes, both.numbers(), both.restart()).has_value());
  apply(*solver, *newer);
  return 0;
}
