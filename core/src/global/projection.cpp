#include "global/projection.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "model/tuning.h"
#include "search/distance.h"

namespace marble {

Projection::Projection(const ScaledProblem& problem) : nearest_(distance_problem(problem)) {}

double Projection::most_bytes(const ScaledProblem& problem) {
  const double held = std::min<double>(problem.variables(), problem.layout.size());
  return Gram::most_bytes(problem) + 4.0 * held * held * sizeof(double);
}

bool Projection::start(Run& run, ConstVectorRef target) {
  run_ = &run;
  nearest_.g = -target;
  kkt_ = make_engine();
  kkt_beside_ = make_engine();
  if (kkt_ == nullptr || kkt_beside_ == nullptr) return false;
  index_entries();
  system_.emplace(nearest_, *kkt_);
  gram_.emplace(nearest_);
  columns_.emplace(nearest_, *gram_, *system_);
  set_.emplace(*columns_);
  set_->consider(tuning::set_candidates);
  center();
  ++run.factorizations;
  if (!system_->factor(tuning::exact_rho, tuning::tree_delta)) return false;
  const Vector center = -nearest_.g, none = Vector::Zero(nearest_.layout.size());
  far_ = reach_from(nearest_, center);
  box_.emplace(nearest_, far_, tuning::set_box_passes);
  Vector z = center, y = Vector::Zero(nearest_.equalities()), slacks(nearest_.layout.size());
  if (!system_->minimize(none, z, y)) return false;
  multiply(nearest_.rows, z, slacks);
  slacks += nearest_.offset;
  set_->start(none, slacks);
  return true;
}

std::unique_ptr<Kkt> Projection::make_engine() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  KktCost least;
  std::unique_ptr<Kkt> kkt = make_kkt(nearest_, {std::min(tuning::set_bytes, run_->bytes_left), kInfinity},
                                      run_->interrupt(), least);
  if (kkt == nullptr) return kkt;
  kkt->attend(run_->interrupt());
  kkt->load(nearest_);
  return kkt;
}

// Moves the target to where rows have a margin, as far as they can: where few rows are near, few are held.
// The minimum of the distance and of what rows lack of it, squared.
void Projection::center() {
  const RowLayout& layout = nearest_.layout;
  RowWeights weights(nearest_);
  weights.rho = tuning::exact_rho;
  weights.delta = tuning::tree_delta;
  Vector z = -nearest_.g, y = Vector::Zero(nearest_.equalities());
  Vector rows(layout.size()), lacking(layout.size()), equality(nearest_.equalities()), dz, dy, last;
  constexpr double margin = 1.0;  // the size of scaled data
  for (int pass = 0; pass < tuning::set_centerings; ++pass) {
    multiply(nearest_.rows, z, rows);
    rows += nearest_.offset;
    for (Index row = 0; row < layout.size(); ++row) {
      const bool lacks = rows[row] < margin;
      weights.rows.all[row] = lacks ? tuning::set_weight : 0.0;
      lacking[row] = lacks ? tuning::set_weight * (margin - rows[row]) : 0.0;
    }
    if (pass > 0 && weights.rows.all == last) break;
    last = weights.rows.all;
    dz = -(z + nearest_.g);
    add_transposed(nearest_.A, -y, dz);
    add_transposed(nearest_.rows, lacking, dz);
    multiply(nearest_.A, z, equality);
    dy = -equality - nearest_.b;
    ++run_->factorizations;
    if (!kkt_->factor(weights) || !kkt_->solve(dz, dy) || !dz.allFinite()) break;
    z += dz;
    y += dy;
  }
  nearest_.g = -z;
}

void Projection::ignore_inequalities() {
  for (Index row = 0; row < nearest_.layout.inequalities; ++row)
    set_->set_kind(row, DualActiveSet::RowKind::ignored);
}

Projection::End Projection::solve() {
  const Interrupt& interrupt = run_->interrupt();
  const DualActiveSet::End end =
      set_->run(std::numeric_limits<double>::infinity(), tuning::tree_steps, interrupt);
  if (end == DualActiveSet::End::optimal) return End::point;
  if (!interrupt.requested() &&
      ((end == DualActiveSet::End::infeasible && prove(set_->ray())) || prove_from_nothing()))
    return End::contradiction;
  return interrupt.requested() ? End::interrupted : End::undecided;
}

// The ray of the dual active set, sharpened: what rounding leaves of Aᵀy − Jᵀμ = −r is taken away along the
// rows of the ray, where (I + Jᵀ W J) dz + Aᵀ dy = r: y + dy and μ − W J dz leave dz. Inequalities whose
// multiplier turns negative are none of its rows. Those held are independent, so that a ray has no row to
// spare.
bool Projection::prove(const Vector& ray) {
  const RowLayout& layout = nearest_.layout;
  RowWeights weights(nearest_);
  weights.rho = tuning::exact_rho;
  weights.delta = tuning::tree_delta;
  Vector mu = ray / max_abs(ray), y = Vector::Zero(nearest_.equalities());
  for (Index row = 0; row < layout.size(); ++row)
    weights.rows.all[row] = mu[row] != 0.0 ? tuning::exact_rho : 0.0;
  Vector dz(nearest_.variables()), dy(nearest_.equalities()), moved(layout.size());
  bool is_factored = false;
  for (int pass = 0; pass < tuning::set_refinements; ++pass) {
    dz.setZero();
    add_transposed(nearest_.A, -y, dz);
    add_transposed(nearest_.rows, mu, dz);
    if (pass > 0 && accept({true, {}, y, mu})) return true;
    if (!is_factored) {
      ++run_->factorizations;
      if (!kkt_beside_->factor(weights)) return false;
    }
    is_factored = true;
    dy.setZero();
    if (!kkt_beside_->solve(dz, dy) || !dz.allFinite() || !dy.allFinite()) return false;
    multiply(nearest_.rows, dz, moved);
    y += dy;
    mu -= weights.rows.all.cwiseProduct(moved);
    for (Index row = 0; row < layout.size(); ++row) {
      if (mu[row] >= 0.0 || is_fixed(row)) continue;
      is_factored = is_factored && mu[row] > -tuning::rounding;
      if (mu[row] <= -tuning::rounding) weights.rows.all[row] = 0.0;
      mu[row] = 0.0;
    }
  }
  return false;
}

// What is noise beside the other multipliers, by what is left of their sum, is left out. Then whether they
// contradict the rows.
bool Projection::accept(LeafMultipliers proof) {
  for (Index row = 0; row < proof.rows.size(); ++row) {
    if (proof.rows[row] < 0.0 && !is_fixed(row)) return false;  // of another node
  }
  Vector rest = Vector::Zero(nearest_.variables());
  add_transposed(nearest_.A, proof.y, rest);
  add_transposed(nearest_.rows, -proof.rows, rest);
  const double noise = tuning::set_noise * max_abs(rest);
  const auto is_noise = [noise](double multiplier) { return std::abs(multiplier) <= noise; };
  std::ranges::replace_if(proof.y, is_noise, 0.0);
  std::ranges::replace_if(proof.rows, is_noise, 0.0);
  clean(proof);
  if (!DualBound(nearest_).contradicts(*box_, proof.y, proof.rows)) return false;
  needed_.clear();
  for (Index row = nearest_.layout.inequalities; row < nearest_.layout.size(); ++row) {
    if (proof.rows[row] < 0.0) needed_.push_back(row);
  }
  contradiction_ = std::move(proof);
  return true;
}

void Projection::index_entries() {
  entries_.assign(static_cast<std::size_t>(nearest_.variables()), {});
  const RowMatrix& matrix = nearest_.rows;
  for (Index row = 0; row < matrix.rows; ++row) {
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      if (matrix.values[k] != 0.0)
        entries_[static_cast<std::size_t>(matrix.column_indices[k])].emplace_back(row, matrix.values[k]);
    }
  }
  const auto length = [&matrix](const std::pair<Index, double>& entry) {
    return matrix.row_pointers[entry.first + 1] - matrix.row_pointers[entry.first];
  };
  for (auto& column : entries_) std::ranges::stable_sort(column, {}, length);
}

// Where a variable has one bound only, what is left of its sum must pull to that one: whatever the other
// variables cost for it is paid for within their bounds. Takes it from the row with the fewest entries.
void Projection::clean(LeafMultipliers& proof) const {
  const auto n = static_cast<std::size_t>(nearest_.variables());
  std::vector<double> rest(n, 0.0), size(n, 0.0);
  const auto add = [&](const RowMatrix& matrix, Index row, double multiplier) {
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      const auto j = static_cast<std::size_t>(matrix.column_indices[k]);
      rest[j] += matrix.values[k] * multiplier;
      size[j] += std::abs(matrix.values[k] * multiplier);
    }
  };
  for (Index row = 0; row < nearest_.equalities(); ++row) add(nearest_.A, row, proof.y[row]);
  for (Index row = 0; row < nearest_.layout.size(); ++row) add(nearest_.rows, row, -proof.rows[row]);
  for (Index j = 0; j < nearest_.variables(); ++j) {
    const bool below = std::isfinite(box_->lower[j]), above = std::isfinite(box_->upper[j]);
    if (below == above) continue;
    const auto at = static_cast<std::size_t>(j);
    for (const auto& [row, value] : entries_[at]) {
      const double wrong = (below ? -rest[at] : rest[at]) + tuning::roundoff * size[at];
      if (wrong <= 0.0) break;
      double change = (below ? -wrong : wrong) / value;
      if (!is_fixed(row)) change = std::max(change, -proof.rows[row]);
      proof.rows[row] += change;
      add(nearest_.rows, row, -change);
    }
  }
}

// By an interior point method, where rows that are nearly dependent have misled the active set.
bool Projection::prove_from_nothing() {
  if (interior_ == nullptr) {
    std::unique_ptr<Kkt> kkt = make_engine();
    if (kkt == nullptr) return false;
    interior_ = std::make_unique<InteriorPoint>(nearest_, std::move(kkt));
  }
  static_cast<void>(interior_->start(-nearest_.g));
  for (Index row = nearest_.layout.inequalities; row < nearest_.layout.size(); ++row) {
    if (is_fixed(row)) interior_->fix(row);
  }
  const std::int64_t before = interior_->factorizations();
  const NodeEngine::End end =
      interior_->solve(*box_, std::numeric_limits<double>::infinity(), run_->interrupt());
  run_->factorizations += static_cast<std::int32_t>(interior_->factorizations() - before);
  if (end != NodeEngine::End::infeasible && end != NodeEngine::End::undecided) return false;
  // It has no ray if its multipliers never grew.
  if (LeafMultipliers ray = interior_->contradiction(); ray.rows.size() > 0 && accept(std::move(ray)))
    return true;
  Vector active = interior_->multipliers();
  for (Index row = 0; row < nearest_.layout.size(); ++row) {
    if (!is_fixed(row) && active[row] < interior_->slacks()[row]) active[row] = 0.0;
  }
  return prove(active);
}

Vector Projection::z() {
  Vector z = -nearest_.g, y = Vector::Zero(nearest_.equalities());
  static_cast<void>(system_->minimize(set_->multipliers(), z, y));
  return z;
}

double Projection::radius() const {
  return box_->is_bounded() ? std::numeric_limits<double>::infinity() : far_;
}

}  // namespace marble
