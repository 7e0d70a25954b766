#include "marble/research/conditioning.h"

#include "model/printed.h"
#include "model/tuning.h"
#include "path/path.h"
#include "research/full_jacobian.h"

namespace marble {

// The path stops whenever κ has fallen by this factor since the last stop.
Expected<PathConditions> path_conditions(const Problem& problem, const Options& user_options,
                                         const SolveControls& controls) {
  MARBLE_RETURN_IF_ERROR(validate(user_options));
  const Options options = in_force(user_options);
  const ScaledProblem scaled = scale(problem, options.scaling_passes);
  const Interrupt interrupt(controls.stop);
  const std::unique_ptr<Kkt> kkt = make_kkt(scaled, interrupt);
  if (kkt == nullptr) {
    return unexpected(interrupt.stop_requested()
                          ? failure(ErrorCode::cancelled, "stopped while the problem was prepared")
                          : failure(ErrorCode::resource_exhausted, "problem", "",
                                    "there is no memory for its linear system"));
  }
  Run run(options, controls);
  kkt->attend(run.interrupt());
  PathEngine path(scaled, *kkt, options);
  path.start(Vector::Zero(scaled.variables()));
  PathConditions found;
  std::optional<Ending> end;
  double kappa = path.subproblem().kappa;
  while (!end) {
    end = path.follow(run, tuning::progress * kappa);
    const Subproblem& sub = path.subproblem();
    if (!path.is_lost() && (!end || is_solved(end->status)) && sub.kappa < kappa) {
      found.at.push_back(
          {sub.kappa, condition_estimate(full_jacobian(scaled, sub, path.iterate(), path.regularization())),
           run.iterations});
    }
    kappa = std::min(kappa, sub.kappa);
  }
  found.status = end->status;
  found.detail = end->detail;
  found.iterations = run.iterations;
  return found;
}

}  // namespace marble
