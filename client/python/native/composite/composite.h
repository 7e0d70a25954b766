// One plan for many worlds, and problems tied by rows, in this process.
#pragma once

#include <pybind11/pybind11.h>

namespace marble::python {

/// marble._core.solve_scenarios(problem, options, wish, tell_level, call): what run() answers, and
/// "scenarios", what ScenarioAnswer has beside it. wish: first_stage, own_equalities, own_inequalities,
/// own_pairs, settings by their names, and worlds as `table` (entries, values, weights) or `sampler` (seed,
/// quantities), where entries are (number of the part, positions).
void bind_scenarios(pybind11::module_& module);

/// marble._core.solve_coupled(blocks, total, prices, options, settings, open, call), blocks as (problem, E or
/// None), and solve_in_pieces(problem, stages, pieces, look_ahead, options, settings, open, call): what run()
/// answers, and "coupled", the fields of Coordination; of blocks also "prices". open: None, for blocks in
/// this process; or what opens a block's solver, given its problem as dict_of has it and its name: a function
/// of changes, as dict_of has them, and of the answer to begin at, or None, to a marble.Solution. All blocks
/// are asked at once, each on a thread that waits.
void bind_coupled(pybind11::module_& module);

}  // namespace marble::python
