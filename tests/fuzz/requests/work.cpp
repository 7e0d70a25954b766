#include "requests/work.h"

#include <algorithm>
#include <utility>

#include "base/wire.h"
#include "expect.h"
#include "requests/findings.h"
#include "requests/judge.h"
#include "service/reply.h"

namespace marble::fuzz {
namespace {

class CountedRows final : public ProgressSink {
 public:
  void report(const Progress& progress) override {
    FUZZ_EXPECT(progress.iteration >= 0);
    ++rows;
  }
  std::int64_t rows = 0;
};

// A count that is not there counts as one that is too large.
template <class Count>
bool exceeds(bool there, Count value, std::int64_t most) {
  return !there || static_cast<std::int64_t>(value) > most;
}

}  // namespace

SmallParts::SmallParts(std::int64_t queue_bytes, std::int64_t result_bytes)
    : IdleParts(queue_bytes, result_bytes) {
  config.solve_bytes = std::int64_t{16} << 20;
  config.scenarios = 12;
  config.coupled_blocks = 6;
  config.sensitivity_rows = 8;
  config.sensitivity_directions = 8;
}

void limit_budgets(v1::SolveOptions* o) {
#define MARBLE_LIMIT(name, most) \
  if (exceeds(o->has_##name(), o->name(), most)) o->set_##name(most);
  MARBLE_LIMIT(max_iterations, 150)
  MARBLE_LIMIT(max_local_search_factorizations, 60)
  MARBLE_LIMIT(max_feasibility_factorizations, 60)
  MARBLE_LIMIT(max_small_problem_nodes, 30)
  MARBLE_LIMIT(node_limit, 40)
#undef MARBLE_LIMIT
  if (o->num_starts() > 3) o->set_num_starts(3);
  if (!o->has_effort() || o->effort() > 3.0) o->set_effort(1.0);
  if (o->time_limit_s() > 0.0) o->clear_time_limit_s();
}

void limit_budgets(v1::SolveRequest* request) {
  limit_budgets(request->mutable_options());
  if (!request->has_coupled()) return;
  v1::Coupled& c = *request->mutable_coupled();
  if (exceeds(c.has_max_iterations(), c.max_iterations(), 15)) c.set_max_iterations(15);
  if (exceeds(c.has_max_searches(), c.max_searches(), 1)) c.set_max_searches(1);
  if (exceeds(c.has_max_pair_switches(), c.max_pair_switches(), 2)) c.set_max_pair_switches(2);
}

server::Caller any_caller() {
  using server::Role;
  server::Caller caller;
  caller.identity.client = "fuzz";
  caller.identity.roles = server::Roles::all();
  return caller;
}

std::optional<Done> solve(const server::ServiceParts& parts, server::JobKind kind,
                          std::shared_ptr<const v1::SolveRequest> request) {
  auto job = server::make_job(parts, any_caller(), kind, std::move(request));
  if (!job) {
    ++tally().refused;
    expect_sound(job.error());
    FUZZ_EXPECT(!job.error().field.empty());
    return std::nullopt;
  }
  CountedRows rows;
  server::Outcome outcome;
  outcome.solution = (*job)->work({.progress = &rows});
  outcome.also = (*job)->also;
  v1::SolveResponse response, read;
  if (const auto filled = server::fill_response(*(*job)->record, outcome, &response); !filled) {
    ++tally().refused;
    expect_sound(filled.error());
    return std::nullopt;
  }
  grpc::ByteBuffer bytes = server::serialize(response);
  FUZZ_EXPECT(server::parse(&bytes, &read, 100000).has_value());
  FUZZ_EXPECT(read.solution().status() == response.solution().status());
  return Done{*std::move(job), std::move(*read.mutable_solution())};
}

}  // namespace marble::fuzz
