#include "requests/make.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <vector>

namespace marble::fuzz {
namespace {

using Values = std::vector<double>;

template <class Numbers>
void assign(const Values& values, Numbers* out) {
  out->Assign(values.begin(), values.end());
}

Values drawn(std::size_t size, Draw& draw) {
  Values values(size);
  for (double& value : values) value = draw.friendly();
  return values;
}

// One without entries, in a valid or an invalid form.
void make_empty(int rows, int columns, Draw& draw, v1::SparseMatrix* out) {
  const int form = draw.between(0, 9);
  if (rows == 0 && form < 6) return out->Clear();
  out->set_rows(rows);
  out->set_columns(columns);
  if (form == 7) {
    out->add_row_indices(draw.between(0, 70000));
  } else if (form != 8) {
    for (int j = 0; j <= columns; ++j) out->add_column_pointers(0);
  }
}

// rows × columns with a few entries, none of them zero.
void make_matrix(int rows, int columns, Draw& draw, v1::SparseMatrix* out) {
  if (rows == 0 || columns == 0) return make_empty(rows, columns, draw, out);
  out->set_rows(rows);
  out->set_columns(columns);
  out->add_column_pointers(0);
  for (int j = 0; j < columns; ++j) {
    for (int i = 0; i < rows; ++i) {
      if (!draw.chance(i % columns == j ? 90 : 35)) continue;
      const double value = draw.friendly();
      if (value == 0.0) continue;
      out->add_row_indices(i);
      out->add_values(value);
    }
    out->add_column_pointers(out->values_size());
  }
}

Values times(const v1::SparseMatrix& m, const Values& z, int rows) {
  Values out(static_cast<std::size_t>(rows));
  for (int j = 0; j + 1 < m.column_pointers_size(); ++j) {
    for (int k = m.column_pointers(j); k < m.column_pointers(j + 1) && k < m.values_size(); ++k)
      out[static_cast<std::size_t>(m.row_indices(k))] += m.values(k) * z[static_cast<std::size_t>(j)];
  }
  return out;
}

// Symmetric: mostly a sum of squares, sometimes not convex, sometimes nothing.
void make_hessian(int n, Draw& draw, v1::Problem* out) {
  const bool upper = draw.chance(40);
  out->set_hessian_form(upper ? v1::HESSIAN_FORM_UPPER_TRIANGLE : v1::HESSIAN_FORM_FULL);
  std::map<std::pair<int, int>, double> entries;  // by column and row
  const bool nothing = draw.chance(10);
  for (int j = 0; j < n && !nothing; ++j) {
    if (draw.chance(90)) entries[{j, j}] += 1.0 + draw.between(0, 3);
    if (!draw.chance(40)) continue;
    const int i = static_cast<int>(draw.below(static_cast<std::size_t>(n)));
    const double a = draw.chance(80) ? 1.0 : 4.0;  // 4: no square, but for a large diagonal
    if (i == j) continue;
    const double sign = draw.chance(50) ? 1.0 : -1.0;
    entries[{i, i}] += 1.0, entries[{j, j}] += 1.0;
    entries[{std::max(i, j), std::min(i, j)}] += sign * a;
    if (!upper) entries[{std::min(i, j), std::max(i, j)}] += sign * a;
  }
  v1::SparseMatrix* Q = out->mutable_hessian();
  if (entries.empty()) return make_empty(draw.chance(50) ? n : 0, n, draw, Q);
  Q->set_rows(n);
  Q->set_columns(n);
  Q->add_column_pointers(0);
  auto entry = entries.begin();
  for (int j = 0; j < n; ++j) {
    for (; entry != entries.end() && entry->first.first == j; ++entry) {
      Q->add_row_indices(entry->first.second);
      Q->add_values(entry->second);
    }
    Q->add_column_pointers(Q->values_size());
  }
}

// Replaces a few numbers by hostile ones.
void spoil(v1::Problem* problem, Draw& draw) {
  for (auto* numbers : {problem->mutable_gradient(), problem->mutable_equality_offset(),
                        problem->mutable_inequality_offset(), problem->mutable_left_offset(),
                        problem->mutable_right_offset(), problem->mutable_equality_matrix()->mutable_values(),
                        problem->mutable_left_matrix()->mutable_values(),
                        problem->mutable_right_matrix()->mutable_values()}) {
    if (!numbers->empty() && draw.chance(25))
      numbers->Set(static_cast<int>(draw.below(static_cast<std::size_t>(numbers->size()))), draw.hostile());
  }
}

v1::Problem make_problem_of(int n, int pairs, Draw& draw) {
  v1::Problem p;
  if (draw.chance(20)) p.set_name(draw.chance(80) ? "fuzz" : std::string(300, 'n'));
  make_hessian(n, draw, &p);
  assign(drawn(static_cast<std::size_t>(n), draw), p.mutable_gradient());
  if (draw.chance(20)) p.set_constant(draw.friendly());
  const int equalities = draw.chance(40) ? draw.between(1, 2) : 0;
  const int inequalities = draw.chance(50) ? draw.between(1, 3) : 0;
  make_matrix(equalities, n, draw, p.mutable_equality_matrix());
  make_matrix(inequalities, n, draw, p.mutable_inequality_matrix());
  if (pairs <= n / 2 && draw.chance(50)) {  // variables themselves
    for (auto* side : {p.mutable_left_matrix(), p.mutable_right_matrix()}) {
      const int first = side == p.mutable_left_matrix() ? 0 : pairs;
      if (pairs == 0) {
        make_empty(0, n, draw, side);
        continue;
      }
      side->set_rows(pairs);
      side->set_columns(n);
      side->add_column_pointers(0);
      for (int j = 0; j < n; ++j) {
        if (j >= first && j < first + pairs) side->add_row_indices(j - first), side->add_values(1.0);
        side->add_column_pointers(side->values_size());
      }
    }
  } else {
    make_matrix(pairs, n, draw, p.mutable_left_matrix());
    make_matrix(pairs, n, draw, p.mutable_right_matrix());
  }
  // Offsets for a point that is feasible, or any.
  const bool feasible = draw.chance(80);
  const Values z = drawn(static_cast<std::size_t>(n), draw);
  const auto offset = [&](const v1::SparseMatrix& m, int rows, const auto& slack, auto* out) {
    const Values at = times(m, z, rows);
    for (int i = 0; i < rows; ++i)
      out->Add(feasible ? slack(i) - at[static_cast<std::size_t>(i)] : draw.friendly());
  };
  std::vector<bool> left(static_cast<std::size_t>(pairs));
  for (auto&& side : left) side = draw.chance(50);
  const auto zero = [](int) { return 0.0; };
  const auto some = [&](int) { return static_cast<double>(draw.between(0, 2)); };
  offset(p.equality_matrix(), equalities, zero, p.mutable_equality_offset());
  offset(p.inequality_matrix(), inequalities, some, p.mutable_inequality_offset());
  offset(
      p.left_matrix(), pairs,
      [&](int i) {
        return left[static_cast<std::size_t>(i)] ? static_cast<double>(draw.between(0, 2)) : 0.0;
      },
      p.mutable_left_offset());
  offset(
      p.right_matrix(), pairs,
      [&](int i) {
        return left[static_cast<std::size_t>(i)] ? 0.0 : static_cast<double>(draw.between(0, 2));
      },
      p.mutable_right_offset());
  if (draw.chance(15)) spoil(&p, draw);
  return p;
}

void make_options(Draw& draw, v1::SolveOptions* o) {
  if (draw.chance(30)) return;
  if (draw.chance(25)) o->set_path(static_cast<v1::Path>(draw.between(1, 3)));
  if (draw.chance(3)) o->set_method(static_cast<v1::Method>(draw.between(1, 10)));
  if (draw.chance(10)) o->set_retraction(static_cast<v1::Retraction>(draw.between(1, 2)));
  if (draw.chance(20)) o->set_global_search(true);
  if (draw.chance(10)) o->set_num_starts(draw.between(1, 4));
  if (draw.chance(10)) o->set_effort(draw.between(0, 3));
  if (draw.chance(10)) o->set_polish(draw.chance(50));
  if (draw.chance(10)) o->set_max_local_search_factorizations(draw.between(0, 100));
  if (draw.chance(10)) o->set_max_small_problem_nodes(draw.between(0, 30));
  if (draw.chance(10)) o->set_max_feasibility_factorizations(draw.between(0, 50));
  if (draw.chance(10)) o->set_node_limit(draw.between(1, 30));
  if (draw.chance(10)) o->set_scaling_passes(draw.between(0, 20));
  if (draw.chance(10)) o->set_max_iterations(draw.between(0, 50));
  if (draw.chance(5)) o->set_relative_gap_tolerance(0.5 * draw.between(0, 1));
  if (draw.chance(5)) o->set_equality_tolerance(draw.chance(50) ? 1e-9 : 0.1);
  if (draw.chance(5)) o->set_complementarity_tolerance(draw.chance(50) ? 1e-9 : 0.1);
  if (draw.chance(5)) o->set_stationarity_tolerance(draw.chance(50) ? 1e-10 : 0.1);
  if (draw.chance(3)) o->set_kappa_initial(draw.hostile());
  if (draw.chance(3)) o->set_rho_max(draw.hostile());
}

void start_point(int n, Draw& draw, v1::InitialPoint* out) {
  for (int i = 0; i < n; ++i) out->add_z(draw.chance(15) ? draw.hostile() : draw.friendly());
}

template <class Vectors>
void weigh(const v1::Problem& p, int count, Draw& draw, Vectors* out) {
  const auto put = [&](int size, auto* numbers) {
    if (draw.chance(60)) assign(drawn(static_cast<std::size_t>(count * size), draw), numbers);
  };
  if constexpr (requires { out->mutable_z(); }) {
    put(p.gradient_size(), out->mutable_z());
    put(p.equality_offset_size(), out->mutable_equality_multipliers());
    put(p.inequality_offset_size(), out->mutable_inequality_multipliers());
    put(p.left_offset_size(), out->mutable_complementarity_multipliers_l());
    put(p.right_offset_size(), out->mutable_complementarity_multipliers_r());
  } else {
    put(p.gradient_size(), out->mutable_gradient());
    put(p.equality_offset_size(), out->mutable_equality_offset());
    put(p.inequality_offset_size(), out->mutable_inequality_offset());
    put(p.left_offset_size(), out->mutable_left_offset());
    put(p.right_offset_size(), out->mutable_right_offset());
    put(p.hessian().values_size(), out->mutable_hessian_values());
    put(p.equality_matrix().values_size(), out->mutable_equality_values());
    put(p.inequality_matrix().values_size(), out->mutable_inequality_values());
    put(p.left_matrix().values_size(), out->mutable_left_values());
    put(p.right_matrix().values_size(), out->mutable_right_values());
  }
}

void make_sensitivity(const v1::Problem& p, Draw& draw, v1::SensitivityRequest* out) {
  if (draw.chance(40)) {
    make_matrix(draw.between(1, 3), p.gradient_size(), draw, out->mutable_rows()->mutable_matrix());
    out->mutable_rows()->set_columns(draw.chance(50));
    if (draw.chance(20))
      assign(drawn(static_cast<std::size_t>(p.gradient_size()), draw),
             out->mutable_rows()->mutable_gradient());
  }
  if (draw.chance(70)) {
    out->mutable_directions()->set_count(draw.between(1, 3));
    weigh(p, out->directions().count(), draw, out->mutable_directions()->mutable_numbers());
  }
  if (draw.chance(70)) {
    out->mutable_losses()->set_count(draw.between(1, 3));
    weigh(p, out->losses().count(), draw, out->mutable_losses()->mutable_weights());
  }
}

int some_pairs(int n, Draw& draw) { return draw.chance(85) ? draw.between(1, std::max(1, n / 2)) : 0; }

// Entries of a part of the problem that there are some of.
int make_entries(const v1::Problem& p, Draw& draw, v1::ScenarioEntries* out) {
  const std::pair<v1::ProblemPart, int> parts[] = {
      {v1::PROBLEM_PART_CONSTANT, 1},
      {v1::PROBLEM_PART_GRADIENT, p.gradient_size()},
      {v1::PROBLEM_PART_EQUALITY_OFFSET, p.equality_offset_size()},
      {v1::PROBLEM_PART_INEQUALITY_OFFSET, p.inequality_offset_size()},
      {v1::PROBLEM_PART_LEFT_OFFSET, p.left_offset_size()},
      {v1::PROBLEM_PART_RIGHT_OFFSET, p.right_offset_size()},
      {v1::PROBLEM_PART_HESSIAN_VALUES, p.hessian().values_size()},
      {v1::PROBLEM_PART_EQUALITY_VALUES, p.equality_matrix().values_size()},
      {v1::PROBLEM_PART_LEFT_VALUES, p.left_matrix().values_size()}};
  const auto& [part, size] = parts[draw.below(draw.chance(70) ? 2 : std::size(parts))];
  out->set_part(part);
  if (draw.chance(30) || size == 0) return size;
  for (int i = 0; i < size; ++i) {
    if (draw.chance(50)) out->add_positions(i);
  }
  return out->positions_size() > 0 ? out->positions_size() : size;
}

void make_samples(const v1::Problem& p, Draw& draw, v1::ScenarioSamples* out) {
  const int scenarios = draw.between(1, 5);
  const int entries = make_entries(p, draw, out->add_entries());
  for (int k = 0; k < scenarios * entries; ++k)
    out->add_values(draw.chance(3) ? draw.hostile() : draw.friendly());
  if (!draw.chance(30)) return;
  for (int k = 0; k < scenarios; ++k) out->add_weights(1.0 + draw.between(0, 2));
}

void make_sampler(const v1::Problem& p, Draw& draw, v1::ScenarioSampler* out) {
  out->set_seed(draw.below(1000));
  for (int q = draw.between(1, 2); q > 0; --q) {
    v1::ScenarioQuantity* quantity = out->add_quantities();
    quantity->set_distribution(static_cast<v1::ScenarioQuantity::Distribution>(draw.between(0, 3)));
    quantity->set_location(draw.friendly());
    if (draw.chance(50)) quantity->set_scale(draw.chance(90) ? 0.5 * draw.between(0, 3) : draw.hostile());
    if (draw.chance(20)) quantity->set_least(-1.0);
    if (draw.chance(20)) quantity->set_most(2.0);
    v1::ScenarioEffect* effect = quantity->add_effects();
    const int entries = make_entries(p, draw, effect->mutable_entries());
    for (int k = draw.chance(50) ? entries : 1; k > 0; --k) effect->add_gains(draw.friendly());
  }
}

v1::ProblemUpdate make_update(const v1::Problem& p, Draw& draw) {
  v1::ProblemUpdate update;
  if (draw.chance(10)) update.set_constant(draw.friendly());
  const auto renew = [&](int percent, const auto& old, auto* out) {
    if (!draw.chance(percent)) return;
    for (const double value : old)
      out->Add(draw.chance(3) ? draw.hostile() : draw.chance(60) ? value : value + 0.25 * draw.friendly());
  };
  renew(40, p.gradient(), update.mutable_gradient());
  renew(40, p.equality_offset(), update.mutable_equality_offset());
  renew(30, p.inequality_offset(), update.mutable_inequality_offset());
  renew(20, p.left_offset(), update.mutable_left_offset());
  renew(20, p.right_offset(), update.mutable_right_offset());
  renew(10, p.equality_matrix().values(), update.mutable_equality_values());
  renew(10, p.left_matrix().values(), update.mutable_left_values());
  if (draw.chance(5))
    assign({p.hessian().values().begin(), p.hessian().values().end()}, update.mutable_hessian_values());
  return update;
}

}  // namespace

v1::Problem make_problem(Draw& draw) {
  const int n = draw.between(1, 7);
  return make_problem_of(n, some_pairs(n, draw), draw);
}

v1::SolveRequest make_solve(Draw& draw) {
  v1::SolveRequest request;
  *request.mutable_problem() = make_problem(draw);
  const v1::Problem& p = request.problem();
  make_options(draw, request.mutable_options());
  if (draw.chance(15)) request.mutable_options()->set_explain(true);
  if (draw.chance(25)) start_point(p.gradient_size(), draw, request.mutable_initial_point());
  if (draw.chance(25)) {
    weigh(p, 1, draw, request.mutable_warm_start());
    start_point(p.gradient_size(), draw, request.mutable_initial_point());
    request.mutable_warm_start()->mutable_z()->Swap(request.mutable_initial_point()->mutable_z());
    request.clear_initial_point();
    v1::WarmStart& start = *request.mutable_warm_start();
    const auto fill = [](int size, auto* numbers) { numbers->Resize(size, 0.0); };
    fill(p.equality_offset_size(), start.mutable_equality_multipliers());
    fill(p.inequality_offset_size(), start.mutable_inequality_multipliers());
    fill(p.left_offset_size(), start.mutable_complementarity_multipliers_l());
    fill(p.right_offset_size(), start.mutable_complementarity_multipliers_r());
  }
  if (draw.chance(40)) make_sensitivity(p, draw, request.mutable_sensitivity());
  if (draw.chance(20)) request.set_request_id(draw.chance(90) ? "fuzz" : "\x01");
  if (draw.chance(20)) request.set_priority(static_cast<v1::Priority>(draw.between(0, 3)));
  return request;
}

v1::SolveRequest make_scenarios(Draw& draw) {
  v1::SolveRequest request;
  const int n = draw.between(2, 6);
  *request.mutable_problem() = make_problem_of(n, some_pairs(n, draw), draw);
  const v1::Problem& p = request.problem();
  make_options(draw, request.mutable_options());
  v1::Scenarios& s = *request.mutable_scenarios();
  const int last = draw.between(0, n - 1);
  for (int j = 0; j < n; ++j) {
    if (j == last || (draw.chance(30) && s.first_stage_size() + 2 < n)) s.add_first_stage(j);
  }
  if (draw.chance(40)) {
    const auto own = [](int size, auto* rows) {
      for (int i = 0; i < size; ++i) rows->Add(i);
    };
    own(p.equality_offset_size(), s.mutable_own_equalities());
    own(p.inequality_offset_size(), s.mutable_own_inequalities());
    own(p.left_offset_size(), s.mutable_own_pairs());
  }
  if (draw.chance(50)) {
    make_samples(p, draw, s.mutable_samples());
  } else {
    make_sampler(p, draw, s.mutable_sampler());
  }
  if (draw.chance(40)) s.set_initial_sample_size(draw.between(1, 3));
  s.set_max_sample_size(
      draw.between(static_cast<int>(std::max<std::int64_t>(1, s.initial_sample_size())), 6));
  s.set_out_of_sample_scenarios(draw.between(0, 4));
  if (draw.chance(20)) s.set_growth(1.5 + static_cast<double>(draw.between(0, 2)));
  if (draw.chance(20)) s.set_tolerance(0.1 * static_cast<double>(draw.between(0, 2)));
  if (draw.chance(20)) s.set_min_sample_size(draw.between(1, 3));
  return request;
}

v1::SolveRequest make_coupled(Draw& draw) {
  v1::SolveRequest request;
  make_options(draw, request.mutable_options());
  v1::Coupled& c = *request.mutable_coupled();
  if (draw.chance(30)) {
    const int n = draw.between(2, 10), stages = draw.between(1, n);
    *request.mutable_problem() = make_problem_of(n, some_pairs(n, draw), draw);
    for (int j = 0; j < n; ++j) c.mutable_segments()->add_stages(j * stages / n);
    c.mutable_segments()->set_num_segments(draw.between(1, std::min(stages, 4)));
    if (draw.chance(30))
      c.mutable_segments()->set_overlap(draw.chance(70) ? draw.between(-1, 3)
                                                        : static_cast<std::int32_t>(draw.hostile_integer()));
  } else {
    const int rows = draw.between(0, 3);
    Values coupling_rhs(static_cast<std::size_t>(rows));
    for (int k = draw.between(1, 3); k > 0; --k) {
      v1::CoupledBlock* block = c.add_blocks();
      const int n = draw.between(1, 4);
      *block->mutable_problem() = make_problem_of(n, draw.between(0, n / 2), draw);
      if (draw.chance(10)) {
        make_empty(draw.chance(50) ? rows : 0, draw.between(0, 9), draw, block->mutable_coupling());
      } else {
        make_matrix(rows, n, draw, block->mutable_coupling());
      }
    }
    if (draw.chance(30)) coupling_rhs = drawn(coupling_rhs.size(), draw);
    assign(coupling_rhs, c.mutable_coupling_rhs());
    if (draw.chance(20)) assign(drawn(coupling_rhs.size(), draw), c.mutable_coupling_multipliers());
    if (draw.chance(20)) c.set_monolithic(draw.chance(50));
  }
  if (draw.chance(20)) c.set_monolithic_search(draw.chance(50));
  if (draw.chance(20)) c.set_max_iterations(draw.between(1, 20));
  if (draw.chance(20)) c.set_freeze_after(draw.between(0, 5));
  if (draw.chance(20)) c.set_max_searches(draw.between(0, 2));
  if (draw.chance(20)) c.set_max_pair_switches(draw.between(0, 3));
  if (draw.chance(10)) c.set_proximal(draw.chance(50) ? 10.0 : draw.hostile());
  if (draw.chance(10)) c.set_tolerance(draw.chance(50) ? 1e-6 : draw.hostile());
  return request;
}

v1::SolveRequest make_any_solve(Draw& draw) {
  const int kind = draw.between(0, 4);
  return kind == 0 ? make_scenarios(draw) : kind == 1 ? make_coupled(draw) : make_solve(draw);
}

Script make_session(Draw& draw) {
  Script script;
  const v1::SolveRequest first = make_solve(draw);
  const v1::Problem& p = first.problem();
  v1::SessionRequest request;
  v1::SessionSetup& setup = *request.mutable_setup();
  *setup.mutable_problem() = p;
  *setup.mutable_options() = first.options();
  if (first.has_initial_point()) *setup.mutable_initial_point() = first.initial_point();
  setup.set_latest_only(draw.chance(30));
  setup.set_progress(draw.chance(20));
  script.add_details()->PackFrom(request);
  std::int64_t sequence = 0;
  for (int k = draw.between(1, 6); k > 0; --k) {
    v1::SessionUpdate& update = *request.mutable_update();
    update.Clear();
    update.set_sequence(draw.chance(95) ? ++sequence : draw.hostile_integer());
    *update.mutable_problem() = make_update(p, draw);
    if (draw.chance(10)) make_options(draw, update.mutable_options());
    if (draw.chance(15)) start_point(p.gradient_size(), draw, update.mutable_initial_point());
    update.set_cold(draw.chance(10));
    update.set_prepare(draw.chance(30));
    const auto move = [&](int size, auto* blocks) {
      v1::ShiftBlock* block = blocks->Add();
      block->set_first(draw.between(0, size));
      block->set_count(draw.between(0, size - block->first()));
      block->set_by(draw.between(0, block->count()));
    };
    if (draw.chance(30)) {
      move(p.gradient_size(), update.mutable_shift()->mutable_variables());
      move(p.left_offset_size(), update.mutable_shift()->mutable_pairs());
    }
    if (!update.prepare() && draw.chance(25)) make_sensitivity(p, draw, update.mutable_sensitivity());
    script.add_details()->PackFrom(request);
  }
  return script;
}

Script make_jobs(Draw& draw) {
  Script script;
  const auto id = [&] { return std::to_string(draw.between(0, 2)); };
  script.add_details()->PackFrom(make_any_solve(draw));
  for (int k = draw.between(1, 6); k > 0; --k) {
    auto* step = script.add_details();
    switch (draw.between(0, 7)) {
      case 0:
        step->PackFrom(make_any_solve(draw));
        break;
      case 1: {
        v1::ListJobsRequest request;
        if (draw.chance(50)) request.add_states(static_cast<v1::JobState>(draw.between(0, 5)));
        request.set_limit(draw.between(-1, 3));
        if (draw.chance(30)) request.set_before_job_id(id());
        step->PackFrom(request);
        break;
      }
#define MARBLE_STEP(number, type) \
  case number: {                  \
    v1::type request;             \
    request.set_job_id(id());     \
    step->PackFrom(request);      \
    break;                        \
  }
        MARBLE_STEP(2, GetJobRequest)
        MARBLE_STEP(3, JobResultRequest)
        MARBLE_STEP(4, JobBundleRequest)
        MARBLE_STEP(5, WatchJobsRequest)
        MARBLE_STEP(6, CancelJobRequest)
        MARBLE_STEP(7, DeleteJobRequest)
#undef MARBLE_STEP
    }
  }
  return script;
}

}  // namespace marble::fuzz
