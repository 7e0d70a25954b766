// An interior point method for the convex relaxation of a node, for problems with a sparse factor and many
// active rows.
//
// Mehrotra's predictor and corrector, with a proximal term on z and on the multipliers of the equalities, so
// that the system is regular for any rows. (Schwan, Jiang, Kuhn and Jones, "PIQP: a proximal interior-point
// quadratic programming solver", 2023.) A fixed side is an equality. Each iteration evaluates the bound that
// the multipliers prove, and the method ends as soon as it reaches the cutoff; the bound of an infeasible
// node grows without limit.
#pragma once

#include <memory>
#include <optional>

#include "global/node_engine.h"
#include "kkt/kkt.h"

namespace marble {

class InteriorPoint final : public NodeEngine {
 public:
  /// `kkt` is its own and belongs to this problem.
  InteriorPoint(const ScaledProblem& problem, std::unique_ptr<Kkt> kkt);

  void attend(const Interrupt& interrupt) override { kkt_->attend(interrupt); }
  [[nodiscard]] bool prepare(Run& run) override;
  [[nodiscard]] bool is_convex(Run& run) override;
  [[nodiscard]] bool start(ConstVectorRef z) override;
  /// Starts from scratch: this method cannot use the rows that the parent held.
  [[nodiscard]] bool start(const Center& center, const std::vector<Index>& held,
                           double parent_bound) override;
  void fix(Index row) override { fixed_[static_cast<std::size_t>(row)] = 1; }
  [[nodiscard]] End solve(const Box& box, double cutoff, const Interrupt& interrupt) override;
  /// Uses a small price on the sum of the slacks.
  [[nodiscard]] std::vector<Index> zero_together(const std::vector<Index>& rows, double rise,
                                                 const Interrupt& interrupt) override;

  [[nodiscard]] double bound() const override { return bound_; }
  [[nodiscard]] Center center() const override { return {z_, y_, mu_, w_}; }
  [[nodiscard]] const Vector& z() const override { return z_; }
  [[nodiscard]] const Vector& y() const override { return y_; }
  [[nodiscard]] const Vector& multipliers() const override { return mu_; }
  [[nodiscard]] const Vector& slacks() const override { return w_; }
  [[nodiscard]] const std::vector<Index>& held() const override { return held_; }
  [[nodiscard]] bool is_held(Index row) const override { return w_[row] == 0.0; }
  [[nodiscard]] const Vector& ray() const override { return signed_; }
  [[nodiscard]] LeafMultipliers contradiction() const override { return {true, {}, ray_y_, signed_}; }
  [[nodiscard]] ProximalSystem* proximal_system(Run& run) override;
  [[nodiscard]] std::int64_t factorizations() const override { return factorizations_; }
  [[nodiscard]] double bytes() override { return kkt_->bytes(); }
  void save() override { saved_ = {fixed_, held_, z_, y_, w_, mu_, bound_}; }
  void restore() override {
    forget_best();
    restore(saved_);
  }

 private:
  struct State {
    std::vector<std::uint8_t> fixed;
    std::vector<Index> held;
    Vector z, y, w, mu;
    double bound;
  };
  void restore(const State& state);
  [[nodiscard]] bool is_fixed(Index row) const { return fixed_[static_cast<std::size_t>(row)] != 0; }
  [[nodiscard]] bool begin();
  void evaluate();
  [[nodiscard]] double violation() const;
  [[nodiscard]] double mean_product(const Vector& w, const Vector& mu) const;
  [[nodiscard]] std::optional<End> examine(const Box& box, double cutoff);
  [[nodiscard]] bool contradicts(const Box& box, double largest);
  [[nodiscard]] bool direction(double kappa, bool corrected);
  [[nodiscard]] bool step();
  void finish();

  const ScaledProblem& problem_;
  std::unique_ptr<Kkt> kkt_;
  ProximalSystem system_;
  DualBound dual_bound_;
  RowWeights weights_;
  std::vector<std::uint8_t> fixed_;  // by row
  Vector z_, y_, w_, mu_;            // w: slacks > 0; unused for fixed rows
  Vector linear_;                    // linear part of the objective
  Vector equality_, rows_, gradient_, stationarity_;
  Vector dz_, dy_, dw_, dmu_, complement_, trial_w_, trial_mu_, ray_y_, ray_mu_, signed_;
  double objective_ = 0.0, bound_ = 0.0;
  std::int64_t factorizations_ = 0;
  std::vector<Index> held_;
  State saved_;
};

/// True if it is likely to solve a node in less time than the active set method: compares its factorizations
/// to some steps of that method, each with all rows times the held ones.
[[nodiscard]] bool interior_point_pays(const ScaledProblem& problem, const Kkt& kkt);

}  // namespace marble
