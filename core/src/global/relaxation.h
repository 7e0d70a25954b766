// The convex relaxation of a node: some pairs have one side fixed at zero, and both sides of the others are ≥
// 0. One engine solves one node after the other, each from its parent's rows, and returns what its
// multipliers prove.
//
// It is the proximal point method around a center: K = [Q + δI, Aᵀ; A, 0] is the same for all nodes and
// regular for any Q. The effect of δ is not part of any bound: it only determines how close to the optimum
// the point comes in one pass.
#pragma once

#include <memory>

#include "global/dual_active_set.h"
#include "global/dual_bound.h"
#include "global/node_engine.h"
#include "global/row_proof.h"

namespace marble {

class Relaxation final : public NodeEngine {
 public:
  /// `kkt` is its own and belongs to this problem.
  Relaxation(const ScaledProblem& problem, std::unique_ptr<Kkt> kkt, Gram& gram);

  void attend(const Interrupt& interrupt) override { kkt_->attend(interrupt); }
  /// Factorizes K. Returns false if Q is not convex, or if interrupted.
  [[nodiscard]] bool prepare(Run& run) override;
  /// True if Q is convex to rounding; takes a separate factorization before that of K.
  [[nodiscard]] bool is_convex(Run& run) override;
  /// Starts around z with nothing fixed and no row held.
  [[nodiscard]] bool start(ConstVectorRef z) override;
  /// Starts around a center with nothing fixed and these rows held.
  [[nodiscard]] bool start(const Center& center, const std::vector<Index>& held,
                           double parent_bound) override;
  /// Fixes a side of a pair at zero.
  void fix(Index row) override { set_.set_kind(row, DualActiveSet::RowKind::fixed); }
  /// Frees sides that were fixed, after restore(), for the next solve(). Returns false if interrupted.
  [[nodiscard]] bool release(const std::vector<Index>& rows);
  /// Solves the relaxation with the current fixings. `cutoff` and bounds are scaled objectives.
  [[nodiscard]] End solve(const Box& box, double cutoff, const Interrupt& interrupt) override;

  [[nodiscard]] double bound() const override { return bound_; }
  /// The center of the last solve().
  [[nodiscard]] Center center() const override {
    return {z_center_, y_center_, set_.center_multipliers(), set_.center_slacks()};
  }
  [[nodiscard]] const Vector& z() const override { return z_; }
  [[nodiscard]] const Vector& y() const override { return y_; }
  [[nodiscard]] const Vector& multipliers() const override { return set_.multipliers(); }
  [[nodiscard]] const Vector& slacks() const override { return set_.slacks(); }
  [[nodiscard]] const std::vector<Index>& held() const override { return set_.held(); }
  [[nodiscard]] bool is_held(Index row) const override { return set_.is_held(row); }
  [[nodiscard]] const Vector& ray() const override { return signed_; }
  [[nodiscard]] LeafMultipliers contradiction() const override { return row_proof_.contradiction(); }
  [[nodiscard]] ProximalSystem* proximal_system(Run& /*run*/) override { return &system_; }
  [[nodiscard]] std::int64_t factorizations() const override { return 0; }  // prepare() counts them
  [[nodiscard]] double first_gain(Index row) { return set_.first_gain(row); }
  [[nodiscard]] double release_gain(Index row) { return set_.release_gain(row); }
  [[nodiscard]] double bytes() override;
  [[nodiscard]] std::int64_t steps() const { return set_.steps(); }
  /// Returns how many points all solves so far have computed.
  [[nodiscard]] std::int64_t points() const { return points_; }

  void save() override;
  void restore() override;

 private:
  [[nodiscard]] bool move_center();
  [[nodiscard]] bool find_point();
  void lengthen_step();
  [[nodiscard]] bool contradicts(const Box& box);
  [[nodiscard]] double evaluate_bound(const Box& box);
  void take_signs_of(const Vector& multipliers);

  const ScaledProblem& problem_;
  std::unique_ptr<Kkt> kkt_;
  ProximalSystem system_;
  RowProof row_proof_;
  GramColumns gram_;
  DualActiveSet set_;
  DualBound dual_bound_;
  Vector z_, y_, z_center_, y_center_;
  Vector signed_, step_, image_, rates_;
  double bound_ = 0.0;
  std::int64_t points_ = 0;
  double estimate_ = -std::numeric_limits<double>::infinity();  // of the objective, after release()
  struct {
    DualActiveSet::State set;
    Vector z, y, z_center, y_center;
    double bound;
  } saved_;
};

}  // namespace marble
