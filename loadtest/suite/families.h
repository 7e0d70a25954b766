// Declares the families of problems of the suite, and what each shows.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "record.h"

namespace marble::suite {

struct Settings {
  int seeds = 20;        ///< of the random families
  int starts = 8;        ///< of the references if none is known
  bool judging = false;  ///< hard, statuses, starts, sessions, proofs, conflicts, scenarios and horizons: use
                         ///< the half of the seeds for judging
  std::string peers;     ///< a command that runs qp_peers.py, or global_peers.py; empty: no peers
  double time_limit_s = 60.0;  ///< of a proof
  Options options;             ///< macmpec and robotics: the options of the solves
  std::string only;  ///< solve only this problem of proofs, coupled, sessions, scenarios; all if empty
  std::string checker = MARBLE_PROOF_CHECKER;  ///< a command that checks the files of proofs
  std::filesystem::path keep;                  ///< proofs: the folder where files are kept; none if empty
  int steps = 0;  ///< coupled and horizons: only this horizon of the hopper; 0: all
};

/// The options on each MacMPEC problem, against the best known objective.
void macmpec(const Settings& settings);
/// Each MacMPEC problem with its data × (1 + 1e-3 noise), `seeds` times, against the best of `starts` starts.
void perturbed(const Settings& settings);
/// The paper's three problems, against the best known objective.
void robotics(const Settings& settings);
/// Variations of the three, against the best of `starts` starts.
void variants(const Settings& settings);
/// Random dense QPECs of 100 and 200 variables, against the best of `starts` starts.
void qpecs(const Settings& settings);
/// Vectors that change by 1e-3, 20 times in a row, warm.
void warm(const Settings& settings);
/// The hopper as in a planner: 50 control steps, warm against cold.
void mpc(const Settings& settings);
/// The hopper at horizons of 30 to 480 steps.
void growth(const Settings& settings);
/// Hoppers of 120 to 1,920 steps with varied numbers, whole against in segments: objectives, work and time.
void horizons(const Settings& settings);
/// Branch and bound on problems with known optima and on the paper's: bounds, nodes and their cost.
void global(const Settings& settings);
/// Each MacMPEC problem in other units of its variables, rows and cost, 10^-8 to 10^8.
void units(const Settings& settings);
/// Two solves at a time on two threads against one.
void throughput(const Settings& settings);
/// Problems whose feasible points are hard to find, and small problems with many minima: solved, wrong, and
/// the work.
void hard(const Settings& settings);
/// Small integers against an enumeration of all branches, and ill-conditioned complementarity problems:
/// checks statuses, optima and bounds.
void statuses(const Settings& settings);
/// Control steps with a feasible plan, the roll-out of the previous inputs: checks that no solution is
/// infeasible, above the plan, or above the optimum of its branch. Five steps per seed.
void starts(const Settings& settings);
/// Sessions of random problems with few pairs, hoppers and cart-poles in closed loop: steps from the last
/// solution against cold solves.
void sessions(const Settings& settings);
/// Proofs written to files and checked by another program: MacMPEC, robots, small integers, families where a
/// feasible point is hard to find, ill-conditioned complementarity problems.
void proofs(const Settings& settings);
/// Planted conflicts, explained, and checked by enumeration.
void conflicts(const Settings& settings);
/// Compares the solver with QP solvers on convex QPs without pairs: random sparse QPs, linear MPC and
/// obstacle problems.
void qp(const Settings& settings);
/// Problems coupled by rows, and hoppers divided into segments: block by block, and whole.
void coupled(const Settings& settings);
/// One plan for sampled scenarios, in growing sample-average stages against all at once: the rocket by its
/// trigger's altitude, the hopper by friction.
void scenarios(const Settings& settings);
/// Many elements of one pattern: one by one, as a session and by a BatchSolver. Objectives against cold
/// solves.
void batches(const Settings& settings);

// Measures the effect of each number of core/src/model/tuning.def: a sweep over generated families of
// problems.
struct Sweep {
  std::vector<std::string> names;                      ///< the numbers to vary one by one; empty: all
  std::vector<std::pair<std::string, double>> values;  ///< or these, all at once, compared with the table's
  int seeds = 10;                                      ///< per family and half
  bool judging = false;                                ///< uses the half that no number was tuned on
  std::string save;     ///< a file for the outcomes of the table's values; nothing else is done
  std::string against;  ///< such a file of another table, with which this one's values are compared
};

/// Prints a row for each number and value, or the table of `values`. Returns false, with a message on stderr,
/// if a name is unknown, or if this is not a build of the preset `tune`, the only one in which numbers can be
/// varied.
[[nodiscard]] bool tune(const Sweep& sweep);

}  // namespace marble::suite
