#include "marble/composite/pieces.h"

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
  Cutter(const ProblemView& problem, std::span<const Index> piece_of_variable, Index pieces,
         const SetupControls& ends)
      : p_(problem),
        piece_of_(piece_of_variable),
        interrupt_(ends.stop, ends.until),
        parts_(at(pieces)),
        copies_(at(pieces)) {}

  [[nodiscard]] Expected<Pieces> cut();

 private:
  struct Part {
    Triplets Q, A, C, L, R;
    std::vector<double> g, b, d, l, r;
  };
  using Places = std::vector<Pieces::Place>;

  [[nodiscard]] Places place_rows(std::span<const SparseMatrixView* const> matrices, std::size_t count);
  [[nodiscard]] Index local(Index piece, Index variable);
  void cut_rows(const SparseMatrixView& m, std::span<const double> offsets, const Places& places,
                Triplets Part::*entries, std::vector<double> Part::*constants);
  void cut_cost();

  [[nodiscard]] Expected<void> may_go_on() const;

  ProblemView p_;
  std::span<const Index> piece_of_;
  Interrupt interrupt_;
  std::vector<Part> parts_;
  std::vector<std::unordered_map<Index, Index>> copies_;  // by piece: variable, its copy there
  std::vector<std::pair<Pieces::Place, Pieces::Place>> ties_;
  Pieces result_;
};

// Checked after each matrix: reading one takes milliseconds per million entries.
Expected<void> Cutter::may_go_on() const {
  if (interrupt_.requested()) {
    return unexpected(
        failure(interrupt_.stop_requested() ? ErrorCode::cancelled : ErrorCode::deadline_exceeded, "pieces",
                "must be cut before the solve is stopped, or its time is over"));
  }
  if (std::ssize(ties_) > kMostCouplingRows) {
    return unexpected(invalid("total", std::to_string(ties_.size()),
                              "copies tie the pieces; must be at most " + std::to_string(kMostCouplingRows)));
  }
  return {};
}

// Returns the index of a variable in a piece; creates a copy there if necessary.
Index Cutter::local(Index piece, Index variable) {
  const Pieces::Place& home = result_.variables[at(variable)];
  if (home.piece == piece) return home.index;
  const auto [copy, made] = copies_[at(piece)].try_emplace(variable, 0);
  if (made) {
    std::vector<double>& g = parts_[at(piece)].g;
    copy->second = static_cast<Index>(g.size());
    g.push_back(0.0);
    ties_.push_back({{piece, copy->second}, home});
  }
  return copy->second;
}

Cutter::Places Cutter::place_rows(std::span<const SparseMatrixView* const> matrices, std::size_t count) {
  Places places(count);
  for (const SparseMatrixView* m : matrices)
    for_entries(*m, [&](Index row, Index j, double) {
      places[at(row)].piece = std::max(places[at(row)].piece, piece_of_[at(j)]);
    });
  std::vector<Index> next(parts_.size(), 0);
  for (Pieces::Place& place : places) place.index = next[at(place.piece)]++;
  return places;
}

void Cutter::cut_rows(const SparseMatrixView& m, std::span<const double> offsets, const Places& places,
                      Triplets Part::*entries, std::vector<double> Part::*constants) {
  for (std::size_t row = 0; row < offsets.size(); ++row)
    (parts_[at(places[row].piece)].*constants).push_back(offsets[row]);
  for_entries(m, [&](Index row, Index j, double value) {
    const Pieces::Place& place = places[at(row)];
    (parts_[at(place.piece)].*entries).add(place.index, local(place.piece, j), value);
  });
}

void Cutter::cut_cost() {
  const bool upper = p_.hessian_form == HessianForm::upper_triangle;
  for_entries(p_.Q, [&](Index i, Index j, double value) {
    if (i > j && !upper) return;  // represented by its mirror image
    const Index last = std::max(piece_of_[at(i)], piece_of_[at(j)]);
    const Index i_there = local(last, i), j_there = local(last, j);
    Triplets& Q = parts_[at(last)].Q;
    Q.add(std::min(i_there, j_there), std::max(i_there, j_there), value);
    for (const Index variable : {i, j}) {
      const Pieces::Place& home = result_.variables[at(variable)];
      if (home.piece == last) continue;
      Q.add(local(last, variable), local(last, variable), std::abs(value));
      parts_[at(home.piece)].Q.add(home.index, home.index, -std::abs(value));
    }
  });
}

Expected<Pieces> Cutter::cut() {
  for (std::size_t j = 0; j < piece_of_.size(); ++j) {
    Part& part = parts_[at(piece_of_[j])];
    result_.variables.push_back({piece_of_[j], static_cast<Index>(part.g.size())});
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
    if (auto on = may_go_on(); !on) return unexpected(on.error());
    cut_rows(*m, offsets, *places, entries, constants);
  }
  if (auto on = may_go_on(); !on) return unexpected(on.error());
  cut_cost();
  if (auto on = may_go_on(); !on) return unexpected(on.error());
  const auto m = static_cast<Index>(ties_.size());
  std::vector<Triplets> coupling(parts_.size());
  for (Index row = 0; row < m; ++row) {
    const auto& [copy, home] = ties_[at(row)];
    coupling[at(copy.piece)].add(row, copy.index, 1.0);
    coupling[at(home.piece)].add(row, home.index, -1.0);
  }
  result_.total.assign(at(m), 0.0);
  for (std::size_t k = 0; k < parts_.size(); ++k) {
    if (auto on = may_go_on(); !on) return unexpected(on.error());
    Part& part = parts_[k];
    const auto n = static_cast<Index>(part.g.size());
    OwnedProblem block;
    block.name = "piece " + std::to_string(k);
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
      auto matrix = made(*entries, rows, name);
      if (!matrix) return unexpected(matrix.error());
      *into = *std::move(matrix);
      *entries = {};
    }
    block.g = std::move(part.g), block.b = std::move(part.b), block.d = std::move(part.d);
    block.l = std::move(part.l), block.r = std::move(part.r);
    auto rows = compress(m, n, coupling[k], "coupling");
    if (!rows) return unexpected(rows.error());
    result_.coupling.push_back(*std::move(rows));
    result_.blocks.push_back(std::move(block));
  }
  result_.blocks.front().c0 = p_.c0;
  return std::move(result_);
}

}  // namespace

CoupledView Pieces::view() const {
  CoupledView view{{}, total};
  for (std::size_t k = 0; k < blocks.size(); ++k)
    view.blocks.push_back({blocks[k].name, blocks[k].view(), coupling[k].view()});
  return view;
}

Solution Pieces::joined(std::span<const BlockAnswer> answers) const {
  Solution whole;
  const auto gather = [&](const std::vector<Place>& places, std::vector<double> Solution::*values) {
    for (const Place& place : places)
      (whole.*values).push_back((answers[at(place.piece)].solution.*values)[at(place.index)]);
  };
  gather(variables, &Solution::z);
  gather(equalities, &Solution::equality_multipliers);
  gather(inequalities, &Solution::inequality_multipliers);
  gather(pairs, &Solution::complementarity_multipliers_L);
  gather(pairs, &Solution::complementarity_multipliers_R);
  return whole;
}

Expected<std::vector<Index>> pieces_by_stage(std::span<const Index> stage_of_variable, Index pieces) {
  if (stage_of_variable.empty()) return unexpected(invalid("stages", "must be one for each variable"));
  for (std::size_t j = 0; j < stage_of_variable.size(); ++j) {
    if (stage_of_variable[j] < 0 || stage_of_variable[j] > kLastStage) {
      return unexpected(invalid("stages", static_cast<std::int64_t>(j), std::to_string(stage_of_variable[j]),
                                "must be in [0, " + std::to_string(kLastStage) + "]"));
    }
  }
  const std::int64_t stages = std::int64_t{*std::ranges::max_element(stage_of_variable)} + 1;
  if (pieces < 1 || pieces > stages) {
    return unexpected(invalid("pieces", std::to_string(pieces),
                              "must be in [1, " + std::to_string(stages) + "], the stages"));
  }
  std::vector<Index> result;
  result.reserve(stage_of_variable.size());
  for (const Index stage : stage_of_variable)
    result.push_back(static_cast<Index>(std::int64_t{stage} * pieces / stages));
  return result;
}

Expected<Pieces> cut(const Problem& problem, std::span<const Index> piece_of_variable,
                     const SetupControls& ends) {
  const auto n = at(problem.variables());
  if (piece_of_variable.size() != n) {
    return unexpected(invalid("pieces", std::to_string(piece_of_variable.size()),
                              "entries; must be " + std::to_string(n) + ", one for each variable"));
  }
  std::vector<std::uint8_t> seen(n, 0);
  for (std::size_t j = 0; j < n; ++j) {
    const Index piece = piece_of_variable[j];
    if (piece < 0 || at(piece) >= n) {
      return unexpected(invalid("pieces", static_cast<std::int64_t>(j), std::to_string(piece),
                                "must be in [0, " + std::to_string(n) + ")"));
    }
    seen[at(piece)] = 1;
  }
  const Index last = *std::ranges::max_element(piece_of_variable);
  seen.resize(at(last) + 1);
  if (const auto none = std::ranges::find(seen, 0); none != seen.end()) {
    return unexpected(
        invalid("pieces", "must give piece " + std::to_string(none - seen.begin()) + " a variable"));
  }
  return Cutter(problem.view(), piece_of_variable, last + 1, ends).cut();
}

// The price of a copy is the remainder of its piece's stationarity at this variable.
CoupledStart Pieces::start(const Solution& whole) const {
  CoupledStart start;
  start.coupling_multipliers.assign(total.size(), 0.0);
  std::vector<std::vector<Index>> home(blocks.size());  // by piece: each variable's index in the whole
  for (std::size_t k = 0; k < blocks.size(); ++k) home[k].assign(blocks[k].g.size(), -1);
  for (std::size_t j = 0; j < variables.size(); ++j)
    home[at(variables[j].piece)][at(variables[j].index)] = static_cast<Index>(j);
  std::vector<Index> origin(total.size());  // of each tie
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
      (start.blocks[at(places[row].piece)].*values).push_back((whole.*values)[row]);
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

Expected<void> PiecesOptions::check() const {
  if (auto valid = coupled.check(); !valid) return valid;
  if (!coupled.monolithic) return unexpected(invalid("monolithic", "must be true of a problem in pieces"));
  if (overlap < -1) return unexpected(invalid("overlap", std::to_string(overlap), "must be >= -1"));
  return {};
}

namespace {

// Returns for each piece the stage after its last one.
std::vector<Index> ends_of(std::span<const Index> stage_of_variable, std::span<const Index> piece_of_variable,
                           Index pieces) {
  std::vector<Index> ends(at(pieces), 0);
  for (std::size_t j = 0; j < piece_of_variable.size(); ++j) {
    Index& end = ends[at(piece_of_variable[j])];
    end = std::max(end, stage_of_variable[j] + 1);
  }
  return ends;
}

// Ends like any solve that is interrupted during set-up.
Expected<PiecesSolution> ended_before(const Problem& problem, const PiecesOptions& options,
                                      const CoupledControls& controls) {
  PiecesSolution result;
  auto whole = solve_once(problem, options.coupled.options, {.stop = controls.stop, .begun = controls.begun},
                          controls.setup);
  if (!whole) return unexpected(whole.error());
  result.whole = *std::move(whole);
  result.coordination.status = result.whole.status;
  result.coordination.detail = "ended before the pieces were cut";
  return result;
}

}  // namespace

Expected<PiecesSolution> solve_in_pieces(const Problem& problem, std::span<const Index> stage_of_variable,
                                         const PiecesOptions& options, const CoupledControls& controls) {
  if (auto valid = options.check(); !valid) return unexpected(valid.error());
  CoupledControls own = controls;
  if (!own.begun) own.begun = std::chrono::steady_clock::now();
  return or_out_of_memory([&]() -> Expected<PiecesSolution> {
    const auto piece_of_variable = pieces_by_stage(stage_of_variable, options.pieces);
    if (!piece_of_variable) return unexpected(piece_of_variable.error());
    if (auto fits = charge(own, tuning::coupled_cut_copies * copy_bytes(problem.view()), "pieces"); !fits)
      return unexpected(fits.error());
    const auto pieces = cut(problem, *piece_of_variable, setup_of(own, options.coupled.options));
    if (!pieces) {
      if (!ends_early(pieces.error())) return unexpected(pieces.error());
      return ended_before(problem, options, own);
    }
    if (auto fits = charge(own, working_bytes(pieces->view()), "pieces"); !fits)
      return unexpected(fits.error());
    const std::vector<Index> ends = ends_of(stage_of_variable, *piece_of_variable, options.pieces);
    auto swept = sweep(
        problem, {.stage_of_variable = stage_of_variable, .ends = ends, .overlap = options.overlap},
        options.coupled.options, {.stop = own.stop, .runner = own.runner, .begun = own.begun}, own.setup);
    if (!swept) return unexpected(swept.error());
    PiecesSolution result;
    result.sweep_factorizations = swept->factorizations;
    result.sweep_objective = swept->objective;
    if (!is_solved(swept->status)) {
      result.coordination.status = swept->status;
      result.coordination.detail = "the pieces were not solved one after the other: " + swept->detail;
      auto whole = stopped(result.coordination)
                       ? solve_from(problem, *std::move(swept), result.coordination, options.coupled, own)
                       : solve_once(problem, options.coupled.options,
                                    {.stop = own.stop, .runner = own.runner, .begun = own.begun}, own.setup);
      if (!whole) return unexpected(whole.error());
      result.whole = *std::move(whole);
      if (!stopped(result.coordination)) result.whole.detail += "; " + result.coordination.detail;
      return result;
    }
    const CoupledStart start = pieces->start(*swept);
    own.start = &start;
    const CoupledView view = pieces->view();
    // The pieces' solvers are destroyed before that of the whole problem is created.
    auto coordination = [&] {
      LiftedBlocks blocks(view, options.coupled, own);
      return coordinate(blocks, view.total, options.coupled, own);
    }();
    if (!coordination) return unexpected(coordination.error());
    result.blocks_objective = sum_of_objectives(*coordination);
    Solution found;
    if (coordination->failed_block && !stopped(*coordination)) {
      found = *std::move(swept);
      coordination->detail += "; so the whole was solved from the pieces one after the other";
    } else {
      found = pieces->joined(coordination->answers);
    }
    auto whole = solve_from(problem, std::move(found), *coordination, options.coupled, own);
    if (!whole) return unexpected(whole.error());
    result.whole = *std::move(whole);
    result.coordination = *std::move(coordination);
    return result;
  });
}

}  // namespace marble
