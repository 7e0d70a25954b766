// A solve request as bytes: it becomes a problem with options, or an error that names its field; what was
// taken can be sent again, and a few iterations on it end.
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <cstdint>

#include "expect.h"
#include "marble/convert.h"
#include "marble/solver.h"
#include "marble/v1/service.pb.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace marble;
  static const google::protobuf::LogSilencer silence;
  v1::SolveRequest request;
  if (!request.ParseFromArray(data, static_cast<int>(size))) return 0;
  const auto options = options_of(request.options());
  if (!options) FUZZ_EXPECT(!options.error().field.empty());
  const auto problem = Problem::create(view_of(request.problem()));
  if (!problem) {
    FUZZ_EXPECT(!message_field(problem.error().field).empty());
    return 0;
  }
  v1::Problem sent;
  to_message(problem->view(), &sent);
  FUZZ_EXPECT(Problem::create(view_of(sent)).has_value());

  Options few = options ? *options : Options{};
  few.max_iterations = std::min(few.max_iterations, 4);
  few.local_search_budget = 0;
  few.starts = 1;
  auto solver = Solver::create(*problem, few, {.most_bytes = std::int64_t{1} << 24});
  if (!solver) return 0;  // too large for this
  const auto answer = solver->solve();
  FUZZ_EXPECT(answer.has_value());
  FUZZ_EXPECT(answer->z.size() == static_cast<std::size_t>(problem->variables()));
  FUZZ_EXPECT(!answer->detail.empty());
  return 0;
}
