#include "lcs/rollout.h"

#include <string>

#include "lcs/check.h"
#include "lcs/dense.h"

namespace marble {
namespace {

std::string reason_of(SmallLcp::End end) {
  if (end != SmallLcp::End::ray && end != SmallLcp::End::pivot_limit) return "the state or lambda overflows";
  return std::string(
             "no lambda >= 0 complementary to E x + F lambda + H u + c >= 0 was found: Lemke's method ") +
         (end == SmallLcp::End::ray ? "ended in a ray" : "made too many pivots");
}

}  // namespace

Expected<void> Rollout::run(const LCS& lcs, LcsTrajectory& trajectory) {
  const Index nx = lcs.states(), nu = lcs.inputs(), nl = lcs.pairs();
  const auto stages = static_cast<Index>(trajectory.u.size()) / nu;
  offset_.resize(nl);
  for (Index k = 0; k < stages; ++k) {
    const LcsStage stage(lcs, k);
    const auto x = stage_of(std::span<const double>(trajectory.x), k, nx);
    const auto u = stage_of(std::span<const double>(trajectory.u), k, nu);
    auto lam = stage_of(std::span<double>(trajectory.lam), k, nl);
    auto next = stage_of(std::span<double>(trajectory.x), k + 1, nx);
    offset_ = stage.c;
    offset_.noalias() += stage.E * x;
    offset_.noalias() += stage.H * u;
    const SmallLcp::End end = lcp_.solve(stage.F, offset_, lam);
    next = stage.d;
    next.noalias() += stage.A * x;
    next.noalias() += stage.B * u;
    next.noalias() += stage.D * lam;
    if (end == SmallLcp::End::solved && next.allFinite()) continue;
    Error error = failure(ErrorCode::failed_precondition, "stages", reason_of(end));
    error.index = k;
    return unexpected(error);
  }
  return {};
}

Expected<LcsTrajectory> rollout(const LCS& lcs, std::span<const double> x0, std::span<const double> u) {
  const auto nx = static_cast<std::size_t>(lcs.states()), nu = static_cast<std::size_t>(lcs.inputs());
  MARBLE_RETURN_IF_ERROR(check_numbers(x0, nx, "x0"));
  const std::size_t stages = u.size() / nu;
  if (u.empty() || u.size() % nu != 0 ||
      (lcs.stages() > 0 && stages != static_cast<std::size_t>(lcs.stages()))) {
    const std::string count =
        lcs.stages() > 0 ? std::to_string(lcs.stages()) + " (stages)" : std::string("stages");
    return unexpected(invalid("u", std::to_string(u.size()),
                              "must have " + count + " times " + std::to_string(nu) + " entries"));
  }
  MARBLE_RETURN_IF_ERROR(check_stages(u, nu, "u"));
  LcsTrajectory made;
  made.x.resize((stages + 1) * nx);
  made.u.assign(u.begin(), u.end());
  made.lam.resize(stages * static_cast<std::size_t>(lcs.pairs()));
  std::ranges::copy(x0, made.x.begin());
  MARBLE_RETURN_IF_ERROR(Rollout().run(lcs, made));
  return made;
}

}  // namespace marble
