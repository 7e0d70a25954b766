#include "marble/composite/segments.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "composite/finish.h"
#include "composite/lifted_blocks.h"
#include "horizon/sweep.h"
#include "model/entries.h"
#include "model/tuning.h"

namespace marble {
namespace {

constexpr Index kLastStage = std::numeric_limits<Index>::max() - 1;  // their number must be an Index too

class Cutter {
 public:
  Cutter(const ProblemView& problem, std::span<const Index> segment_of_variable, Index segments,
         const SetupControls& ends)
      : p_(problem),
        segment_of_(segment_of_variable),
        interrupt_(ends.stop, ends.until, ends.pause),
        parts_(at(segments)),
        copies_(at(segments)) {}

  [[nodiscard]] Expected<Segments> cut();

 private:
  struct Part {
    Triplets Q, A, C, L, R;
    std::vector<double> g, b, d, l, r;
  };
  using Places = std::vector<Segments::Place>;

  [[nodiscard]] Places place_rows(std::span<const SparseMatrixView* const> matrices, std::size_t count);
  [[nodiscard]] Index local(Index segment, Index variable);
  void cut_rows(const SparseMatrixView& m, std::span<const double> offsets, const Places& places,
                Triplets Part::*entries, std::vector<double> Part::*constants);
  void cut_cost();

  [[nodiscard]] Expected<void> may_go_on() const;

  ProblemView p_;
  std::span<const Index> segment_of_;
  Interrupt interrupt_;
  std::vector<Part> parts_;
  std::vector<std::unordered_map<Index, Index>> copies_;  // by segment: variable, its copy there
  std::vector<std::pair<Segments::Place, Segments::Place>> ties_;
  Segments result_;
};

// Checked after each matrix: reading one takes milliseconds per million entries.
Expected<void> Cutter::may_go_on() const {
  if (interrupt_.requested()) {
    return unexpected(
        failure(interrupt_.stop_requested() ? ErrorCode::cancelled : ErrorCode::deadline_exceeded, "segments",
                "must be cut before the solve is stopped, or its time is over"));
  }
  if (std::ssize(ties_) > kMostCouplingRows) {
    return unexpected(
        invalid("coupling_rhs", std::to_string(ties_.size()),
                "copies tie the segments; must be at most " + std::to_string(kMostCouplingRows)));
  }
  return {};
}

// Returns the index of a variable in a segment; creates a copy there if necessary.
Index Cutter::local(Index segment, Index variable) {
  const Segments::Place& home = result_.variables[at(variable)];
  if (home.segment == segment) return home.index;
  const auto [copy, made] = copies_[at(segment)].try_emplace(variable, 0);
  if (made) {
    std::vector<double>& g = parts_[at(segment)].g;
    copy->second = static_cast<Index>(g.size());
    g.push_back(0.0);
    ties_.push_back({{segment, copy->second}, home});
  }
  return copy->second;
}

Cutter::Places Cutter::place_rows(std::span<const SparseMatrixView* const> matrices, std::size_t count) {
  Places places(count);
  for (const SparseMatrixView* m : matrices)
    for_entries(*m, [&](Index row, Index j, double) {
      places[at(row)].segment = std::max(places[at(row)].segment, segment_of_[at(j)]);
    });
  std::vector<Index> next(parts_.size(), 0);
  for (Segments::Place& place : places) place.index = next[at(place.segment)]++;
  return places;
}

void Cutter::cut_rows(const SparseMatrixView& m, std::span<const double> offsets, const Places& places,
                      Triplets Part::*entries, std::vector<double> Part::*constants) {
  for (std::size_t row = 0; row < offsets.size(); ++row)
    (parts_[at(places[row].segment)].*constants).push_back(offsets[row]);
  for_entries(m, [&](Index row, Index j, double value) {
    const Segments::Place& place = places[at(row)];
    (parts_[at(place.segment)].*entries).add(place.index, local(place.segment, j), value);
  });
}

void Cutter::cut_cost() {
  const bool upper = p_.hessian_form == HessianForm::upper_triangle;
  for_entries(p_.Q, [&](Index i, Index j, double value) {
    if (i > j && !upper) return;  // represented by its mirror image
    const Index last = std::max(segment_of_[at(i)], segment_of_[at(j)]);
    const Index i_there = local(last, i), j_there = local(last, j);
    Triplets& Q = parts_[at(last)].Q;
    Q.add(std::min(i_there, j_there), std::max(i_there, j_there), value);
    for (const Index variable : {i, j}) {
      const Segments::Place& home = result_.variables[at(variable)];
      if (home.segment == last) continue;
      Q.add(local(last, variable), local(last, variable), std::abs(value));
      parts_[at(home.segment)].Q.add(home.index, home.index, -std::abs(value));
    }
  });
}

Expected<Segments> Cutter::cut() {
  for (std::size_t j = 0; j < segment_of_.size(); ++j) {
    Part& part = parts_[at(segment_of_[j])];
    result_.variables.push_back({segment_of_[j], static_cast<Index>(part.g.size())});
    part.g.push_back(p_.g[j]);
  }
  const SparseMatrixView* const pair_rows[] = {&p_.L, &p_.R};
  const SparseMatrixView *const A[] = {&p_.A}, *const C[] = {&p_.C};
  result_.equalities = place_rows(A, p_.b.size());
  result_.inequalities = place_rows(C, p_.d.size());
  result_.pairs = place_rows(pair_rows, p_.l.size());
  for (const auto& [m, offsets, places, entries, constants] :
       {std::tuple{&p_.A, p_.b, &result_.equalities, &Part::A, &Part::b},
        std::tuple{&p_.C, p_.d, &result_.inequalities, &Part::C, &Part::d},
        std::tuple{&p_.L, p_.l, &result_.pairs, &Part::L, &Part::l},
        std::tuple{&p_.R, p_.r, &result_.pairs, &Part::R, &Part::r}}) {
    MARBLE_RETURN_IF_ERROR(may_go_on());
    cut_rows(*m, offsets, *places, entries, constants);
  }
  MARBLE_RETURN_IF_ERROR(may_go_on());
  cut_cost();
  MARBLE_RETURN_IF_ERROR(may_go_on());
  const auto m = static_cast<Index>(ties_.size());
  std::vector<Triplets> coupling(parts_.size());
  for (Index row = 0; row < m; ++row) {
    const auto& [copy, home] = ties_[at(row)];
    coupling[at(copy.segment)].add(row, copy.index, 1.0);
    coupling[at(home.segment)].add(row, home.index, -1.0);
  }
  result_.coupling_rhs.assign(at(m), 0.0);
  for (std::size_t k = 0; k < parts_.size(); ++k) {
    MARBLE_RETURN_IF_ERROR(may_go_on());
    Part& part = parts_[k];
    const auto n = static_cast<Index>(part.g.size());
    OwnedProblem block;
    block.name = "segment " + std::to_string(k);
    block.hessian_form = HessianForm::upper_triangle;
    const auto made = [n](const Triplets& entries, std::size_t rows, const char* name) {
      return rows == 0 ? Expected<SparseMatrix>(SparseMatrix{})
                       : compress(static_cast<Index>(rows), n, entries, name);
    };
    for (auto& [into, entries, rows, name] : {std::tuple{&block.Q, &part.Q, part.g.size(), "Q"},
                                              std::tuple{&block.A, &part.A, part.b.size(), "A"},
                                              std::tuple{&block.C, &part.C, part.d.size(), "C"},
                                              std::tuple{&block.L, &part.L, part.l.size(), "L"},
                                              std::tuple{&block.R, &part.R, part.r.size(), "R"}}) {
      MARBLE_ASSIGN_OR_RETURN(*into, made(*entries, rows, name));
      *entries = {};
    }
    block.g = std::move(part.g), block.b = std::move(part.b), block.d = std::move(part.d);
    block.l = std::move(part.l), block.r = std::move(part.r);
    MARBLE_ASSIGN_OR_RETURN(auto rows, compress(m, n, coupling[k], "coupling"));
    result_.coupling.push_back(std::move(rows));
    result_.blocks.push_back(std::move(block));
  }
  result_.blocks.front().c0 = p_.c0;
  return std::move(result_);
}

}  // namespace

CoupledView Segments::view() const {
  CoupledView view{{}, coupling_rhs};
  for (std::size_t k = 0; k < blocks.size(); ++k)
    view.blocks.push_back({blocks[k].name, blocks[k].view(), coupling[k].view()});
  return view;
}

Solution Segments::joined(std::span<const BlockAnswer> answers) const {
  Solution whole;
  const auto gather = [&](const std::vector<Place>& places, std::vector<double> Solution::*values) {
    for (const Place& place : places)
      (whole.*values).push_back((answers[at(place.segment)].solution.*values)[at(place.index)]);
  };
  gather(variables, &Solution::z);
  gather(equalities, &Solution::equality_multipliers);
  gather(inequalities, &Solution::inequality_multipliers);
  gather(pairs, &Solution::complementarity_multipliers_L);
  gather(pairs, &Solution::complementarity_multipliers_R);
  return whole;
}

Expected<std::vector<Index>> segments_by_stage(std::span<const Index> stage_of_variable, Index segments) {
  if (stage_of_variable.empty()) return unexpected(invalid("stages", "must be one for each variable"));
  for (std::size_t j = 0; j < stage_of_variable.size(); ++j) {
    if (stage_of_variable[j] < 0 || stage_of_variable[j] > kLastStage) {
      return unexpected(invalid("stages", static_cast<std::int64_t>(j), std::to_string(stage_of_variable[j]),
                                "must be in [0, " + std::to_string(kLastStage) + "]"));
    }
  }
  const std::int64_t stages = std::int64_t{*std::ranges::max_element(stage_of_variable)} + 1;
  if (segments < 1 || segments > stages) {
    return unexpected(invalid("num_segments", std::to_string(segments),
                              "must be in [1, " + std::to_string(stages) + "], the stages"));
  }
  std::vector<Index> result;
  result.reserve(stage_of_variable.size());
  for (const Index stage : stage_of_variable)
    result.push_back(static_cast<Index>(std::int64_t{stage} * segments / stages));
  return result;
}

Expected<Segments> cut(const Problem& problem, std::span<const Index> segment_of_variable,
                       const SetupControls& ends) {
  const auto n = at(problem.variables());
  if (segment_of_variable.size() != n) {
    return unexpected(invalid("segments", std::to_string(segment_of_variable.size()),
                              "entries; must be " + std::to_string(n) + ", one for each variable"));
  }
  std::vector<std::uint8_t> seen(n, 0);
  for (std::size_t j = 0; j < n; ++j) {
    const Index segment = segment_of_variable[j];
    if (segment < 0 || at(segment) >= n) {
      return unexpected(invalid("segments", static_cast<std::int64_t>(j), std::to_string(segment),
                                "must be in [0, " + std::to_string(n) + ")"));
    }
    seen[at(segment)] = 1;
  }
  const Index last = *std::ranges::max_element(segment_of_variable);
  seen.resize(at(last) + 1);
  if (const auto none = std::ranges::find(seen, 0); none != seen.end()) {
    return unexpected(
        invalid("segments", "must give segment " + std::to_string(none - seen.begin()) + " a variable"));
  }
  return Cutter(problem.view(), segment_of_variable, last + 1, ends).cut();
}

// The price of a copy is the remainder of its segment's stationarity at this variable.
CoupledStart Segments::start(const Solution& whole) const {
  CoupledStart start;
  start.coupling_multipliers.assign(coupling_rhs.size(), 0.0);
  std::vector<std::vector<Index>> home(blocks.size());  // by segment: each variable's index in the whole
  for (std::size_t k = 0; k < blocks.size(); ++k) home[k].assign(blocks[k].g.size(), -1);
  for (std::size_t j = 0; j < variables.size(); ++j)
    home[at(variables[j].segment)][at(variables[j].index)] = static_cast<Index>(j);
  std::vector<Index> origin(coupling_rhs.size());  // of each tie
  for (std::size_t k = 0; k < blocks.size(); ++k)
    for_entries(coupling[k].view(), [&](Index row, Index j, double value) {
      if (value < 0.0) origin[at(row)] = home[k][at(j)];
    });
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    for_entries(coupling[k].view(), [&](Index row, Index j, double value) {
      if (value > 0.0) home[k][at(j)] = origin[at(row)];
    });
    Solution& own = start.blocks.emplace_back();
    for (const Index j : home[k]) own.z.push_back(whole.z[at(j)]);
  }
  const auto deal = [&](const std::vector<Place>& places, std::vector<double> Solution::*values) {
    for (std::size_t row = 0; row < places.size(); ++row)
      (start.blocks[at(places[row].segment)].*values).push_back((whole.*values)[row]);
  };
  deal(equalities, &Solution::equality_multipliers);
  deal(inequalities, &Solution::inequality_multipliers);
  deal(pairs, &Solution::complementarity_multipliers_L);
  deal(pairs, &Solution::complementarity_multipliers_R);
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const OwnedProblem& p = blocks[k];
    const Solution& own = start.blocks[k];
    std::vector<double> residual = p.g;
    for_entries(p.Q.view(), [&](Index i, Index j, double value) {
      residual[at(i)] += value * own.z[at(j)];
      if (i != j) residual[at(j)] += value * own.z[at(i)];
    });
    const auto add = [&](const SparseMatrix& m, const std::vector<double>& multipliers, double sign) {
      for_entries(m.view(), [&](Index row, Index j, double value) {
        residual[at(j)] += sign * value * multipliers[at(row)];
      });
    };
    add(p.A, own.equality_multipliers, 1.0), add(p.C, own.inequality_multipliers, -1.0);
    add(p.L, own.complementarity_multipliers_L, -1.0), add(p.R, own.complementarity_multipliers_R, -1.0);
    for_entries(coupling[k].view(), [&](Index row, Index j, double value) {
      if (value > 0.0) start.coupling_multipliers[at(row)] = -residual[at(j)];
    });
  }
  return start;
}

Expected<void> SegmentsOptions::check() const {
  MARBLE_RETURN_IF_ERROR(coupled.check());
  if (!coupled.monolithic) return unexpected(invalid("monolithic", "must be true of a problem in segments"));
  if (overlap < -1) return unexpected(invalid("overlap", std::to_string(overlap), "must be >= -1"));
  return {};
}

namespace {

// Returns for each segment the stage after its last one.
std::vector<Index> ends_of(std::span<const Index> stage_of_variable,
                           std::span<const Index> segment_of_variable, Index segments) {
  std::vector<Index> ends(at(segments), 0);
  for (std::size_t j = 0; j < segment_of_variable.size(); ++j) {
    Index& end = ends[at(segment_of_variable[j])];
    end = std::max(end, stage_of_variable[j] + 1);
  }
  return ends;
}

// Ends like any solve that is interrupted during set-up.
Expected<SegmentsSolution> ended_before(const Problem& problem, const SegmentsOptions& options,
                                        const CoupledControls& controls) {
  SegmentsSolution result;
  MARBLE_ASSIGN_OR_RETURN(
      result.whole,
      solve_once(problem, options.coupled.options,
                 {.stop = controls.stop, .pause = controls.pause, .begun = controls.begun}, controls.setup));
  result.coordination.status = result.whole.status;
  result.coordination.detail = "ended before the segments were cut";
  return result;
}

}  // namespace

Expected<SegmentsSolution> solve_in_segments(const Problem& problem, std::span<const Index> stage_of_variable,
                                             const SegmentsOptions& options,
                                             const CoupledControls& controls) {
  MARBLE_RETURN_IF_ERROR(options.check());
  CoupledControls own = controls;
  if (!own.begun) own.begun = Interrupt::now(own.pause);
  return or_out_of_memory([&]() -> Expected<SegmentsSolution> {
    MARBLE_ASSIGN_OR_RETURN(const auto segment_of_variable,
                            segments_by_stage(stage_of_variable, options.num_segments));
    MARBLE_RETURN_IF_ERROR(charge(own, tuning::coupled_cut_copies * copy_bytes(problem.view()), "segments"));
    const auto segments = cut(problem, segment_of_variable, setup_of(own, options.coupled.options));
    if (!segments) {
      if (!ends_early(segments.error())) return unexpected(segments.error());
      return ended_before(problem, options, own);
    }
    MARBLE_RETURN_IF_ERROR(charge(own, working_bytes(segments->view()), "segments"));
    const std::vector<Index> ends = ends_of(stage_of_variable, segment_of_variable, options.num_segments);
    const SolveControls alone{.stop = own.stop, .runner = own.runner, .pause = own.pause, .begun = own.begun};
    MARBLE_ASSIGN_OR_RETURN(
        auto swept,
        sweep(problem, {.stage_of_variable = stage_of_variable, .ends = ends, .overlap = options.overlap},
              options.coupled.options, alone, own.setup));
    SegmentsSolution result;
    result.sweep_factorizations = swept.factorizations;
    result.sweep_objective = swept.objective;
    if (!is_solved(swept.status)) {
      result.coordination.status = swept.status;
      result.coordination.detail = "the segments were not solved one after the other: " + swept.detail;
      MARBLE_ASSIGN_OR_RETURN(
          result.whole, stopped(result.coordination)
                            ? solve_from(problem, std::move(swept), result.coordination, options.coupled, own)
                            : solve_once(problem, options.coupled.options, alone, own.setup));
      if (!stopped(result.coordination)) result.whole.detail += "; " + result.coordination.detail;
      return result;
    }
    const CoupledStart start = segments->start(swept);
    own.start = &start;
    const CoupledView view = segments->view();
    // The segments' solvers are destroyed before that of the whole problem is created.
    auto coordination = [&] {
      LiftedBlocks blocks(view, options.coupled, own);
      return coordinate(blocks, view.coupling_rhs, options.coupled, own);
    }();
    if (!coordination) return unexpected(coordination.error());
    result.blocks_objective = sum_of_objectives(*coordination);
    Solution found;
    if (coordination->failed_block && !stopped(*coordination)) {
      found = std::move(swept);
      coordination->detail += "; so the whole was solved from the segments one after the other";
    } else {
      found = segments->joined(coordination->answers);
    }
    MARBLE_ASSIGN_OR_RETURN(result.whole,
                            solve_from(problem, std::move(found), *coordination, options.coupled, own));
    result.coordination = *std::move(coordination);
    return result;
  });
}

}  // namespace marble
