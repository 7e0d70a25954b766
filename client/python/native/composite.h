// Solves one plan for many scenarios, and problems coupled by rows, in this process.
#pragma once

#include <pybind11/pybind11.h>

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

}  // namespace marble::python
