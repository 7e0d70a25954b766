// Two updates of a session, the second of which takes the first along: what the check lets through the solver
// takes. The first byte says where the second message begins.
#include "session_update.h"

#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <cstdint>

#include "expect.h"
#include "marble/convert.h"
#include "marble/warm_solver.h"

namespace {

using namespace marble;

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

bool valid(const v1::SessionUpdate& update, const PartSizes& sizes) {
  const auto checked = server::check_update(update, sizes);
  if (!checked) FUZZ_EXPECT(!checked.error().field.empty());
  return checked.has_value();
}

void apply(const Problem& problem, const v1::SessionUpdate& update) {
  Options few;
  few.max_iterations = 4;
  few.local_search_budget = 0;
  auto solver = WarmSolver::create(problem, few);
  FUZZ_EXPECT(solver.has_value());
  FUZZ_EXPECT(solver->solve().has_value());
  FUZZ_EXPECT(solver->solve(update_of(update.problem()), server::restart_of(update)).has_value());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const google::protobuf::LogSilencer silence;
  static const OwnedProblem owned = small_problem();
  static const Problem problem = Problem::create(owned.view()).value();
  static const PartSizes sizes = PartSizes::of(problem);
  if (size == 0) return 0;
  const std::size_t first = std::min<std::size_t>(data[0], size - 1);
  v1::SessionUpdate older, newer;
  if (!older.ParseFromArray(data + 1, static_cast<int>(first)) ||
      !newer.ParseFromArray(data + 1 + first, static_cast<int>(size - 1 - first)))
    return 0;
  if (!valid(older, sizes) || !valid(newer, sizes)) return 0;
  apply(problem, older);
  server::take_along(older, newer);
  FUZZ_EXPECT(valid(newer, sizes));
  apply(problem, newer);
  return 0;
}
