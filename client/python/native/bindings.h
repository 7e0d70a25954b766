// Declares what the files of this folder bind, for module.cpp.
#pragma once

#include <pybind11/pybind11.h>

#include "marble/retrospective.h"

namespace marble::python {

/// Binds marble._core.solve_scenarios(problem, options, request, report_stage, call): returns the result of
/// run(), and "scenarios", the further fields of ScenarioSolution. request: first_stage, own_equalities,
/// own_inequalities, own_pairs, settings by their names, and the scenarios as `table` (entries, values,
/// weights) or `sampler` (seed, quantities), where entries are (number of the part, positions).
void bind_scenarios(pybind11::module_& module);

/// Binds marble._core.solve_coupled(blocks, coupling_rhs, coupling_multipliers, options, settings, open,
/// call), with blocks as (problem, E or None), and solve_in_segments(problem, stages, segments, overlap,
/// options, settings, open, call). They return the result of run(), and "coupled", the fields of
/// Coordination; for blocks also "coupling_multipliers". open: None, for blocks in this process; or a
/// function that opens a block's solver, given its problem in the form of dict_of and its name: a function of
/// changes, in the form of dict_of, and of the solution to start from, or None, that returns a
/// marble.Solution. All blocks are solved at once, each on a waiting thread.
void bind_coupled(pybind11::module_& module);

/// Binds marble._core.Batches(problem, options), for marble.BatchSolver, the names `statuses` of its codes,
/// and most_batch_elements.
void bind_batches(pybind11::module_& module);

// Provides planners of linear complementarity systems for Python.

/// Binds marble._core.LcsPlanner(lcs, task, options) and lcs_rollout(lcs, x0, u), for marble.lcs.
void bind_lcs(pybind11::module_& module);

// Provides nonlinear problems of Python functions, for the loop of marble::nonlinear.

/// problem: `values`, `derivatives` and `hessian` (or None) as marble.nlp wraps them, and the arrays `start`,
/// `lower`, `upper`, `scale` and `blocks`. Exceptions of the functions propagate.
[[nodiscard]] nonlinear::Problem problem_of(const pybind11::dict& problem);

/// open: None, for LCQPs in process, without the GIL; or a function that opens a session for a problem, in
/// the form of dict_of, and returns its solve function. That takes changes by letter, cold, the seconds left
/// (None: no limit), the shift's blocks of the four kinds of vectors (first, count, by), z0 or None, and
/// whether it is an update's first part. It returns (a marble.Solution, whether it was reopened), or None if
/// the time was up or for a first part.
[[nodiscard]] nonlinear::OpenTicks ticks_of(const pybind11::object& open);

/// Solves a problem, with sessions from `open`.
[[nodiscard]] Expected<nonlinear::Answer> solve_nonlinear(const pybind11::dict& problem,
                                                          const nonlinear::Settings& settings,
                                                          const pybind11::object& open);

/// Solves sample-average stages one after the other. use_samples: called with N before a stage; sample_cost:
/// None, or the cost at x of a sample by its number.
[[nodiscard]] Expected<nonlinear::RetrospectiveAnswer> solve_retrospective(
    const pybind11::dict& problem, const nonlinear::RetrospectiveSettings& settings,
    const pybind11::object& use_samples, const pybind11::object& sample_cost, const pybind11::object& open);

// Provides real-time iteration for Python.

/// Binds marble._core.RealTimeLoop(problem, settings, options, open), for marble.nlp.RealTime.
void bind_real_time(pybind11::module_& module);

}  // namespace marble::python
