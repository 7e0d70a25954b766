// One plan for many worlds, and problems tied by rows, in this process.
#pragma once

#include <pybind11/pybind11.h>

namespace marble::python {

/// marble._core.solve_scenarios(problem, options, wish, tell_level, call): what run() answers, and
/// "scenarios", what ScenarioAnswer has beside it. wish: first_stage, own_equalities, own_inequalities,
/// own_pairs, settings by their names, and worlds as `table` (entries, values, weights) or `sampler` (seed,
/// quantities), where entries are (number of the part, positions).
void bind_scenarios(pybind11::module_& module);

/// marble._core.solve_coupled(blocks, total, prices, options, settings, call), blocks as (problem, E or
/// None), and solve_in_pieces(problem, stages, pieces, look_ahead, options, settings, call): what run()
/// answers, and "coupled", the fields of Coordination; of blocks also "prices".
void bind_coupled(pybind11::module_& module);

}  // namespace marble::python
