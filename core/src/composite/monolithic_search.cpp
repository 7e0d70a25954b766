#include "composite/monolithic_search.h"

#include <limits>
#include <utility>

#include "model/printed.h"
#include "model/tuning.h"
#include "path/path.h"
#include "search/branch_search.h"

namespace marble {

Solution search_near(const Problem& user_problem, Solution start, const Options& user_options,
                     const CoupledControls& controls) {
  const Options options = in_force(user_options);
  const SolveControls how{
      .stop = controls.stop, .runner = controls.runner, .pause = controls.pause, .begun = controls.begun};
  Run run(options, how);  // refers to options and how
  const ScaledProblem problem = scale(user_problem, options.scaling_passes, run.interrupt());
  KktCost least;
  const KktCost most{static_cast<double>(controls.setup.most_bytes), KktCost{}.flops};
  const std::unique_ptr<Kkt> kkt = make_kkt(problem, most, run.interrupt(), least);
  if (kkt == nullptr) return start;
  kkt->attend(run.interrupt());
  PathEngine path(problem, *kkt, options);
  BranchEngines branch(problem, *kkt);
  Incumbent incumbent(problem, options, branch.exact);
  BranchSearch search(problem, *kkt, options, path, branch, incumbent);
  Iterate x(problem);
  take(problem, start, x);
  if (search.start_from(run, x, std::numeric_limits<double>::max())) {
    static_cast<void>(search.improve(run, x.z()));
    for (int round = 0; round < tuning::coupled_further && !run.interrupted(); ++round)
      if (!search.start_round(run, tuning::further_round, {})) break;
  }
  start.factorizations = run.factorizations;
  if (!incumbent.exists()) return start;
  report(problem, incumbent.best().x, start);
  start.reference_objective = problem.user_objective(incumbent.best().objective);
  return start;
}

}  // namespace marble
