// One engine at a time: a problem, scaled, its linear system and a run to count in.
#pragma once

#include <memory>
#include <vector>

#include "kkt/kkt.h"
#include "model/residual.h"
#include "path/run.h"
#include "support/independent_check.h"

namespace marble::testing {

/// Keeps every row that is reported to it, with its vectors.
class Rows : public ProgressSink {
 public:
  explicit Rows(bool pairs = false) : pairs_(pairs) {}
  void report(const Progress& progress) override {
    rows.push_back(without_vectors(progress));
    z.emplace_back(progress.z.begin(), progress.z.end());
    s.emplace_back(progress.s.begin(), progress.s.end());
    t.emplace_back(progress.t.begin(), progress.t.end());
    if (static_cast<int>(rows.size()) == stop_after) source.request_stop();
  }
  [[nodiscard]] bool wants_pairs() const override { return pairs_; }

  std::vector<Progress> rows;
  std::vector<std::vector<double>> z, s, t;
  std::stop_source source;
  int stop_after = 0;  ///< rows; 0 for never

 private:
  bool pairs_;
};

/// Another linear system, to be changed where a test wants it to go wrong.
class WrappedKkt : public Kkt {
 public:
  explicit WrappedKkt(Kkt& inner) : inner_(inner) {}
  [[nodiscard]] bool allocate(const ScaledProblem&) override { return true; }
  void load(const ScaledProblem& problem) override { inner_.load(problem); }
  [[nodiscard]] bool solve(VectorRef x, VectorRef y) override { return inner_.solve(x, y); }
  [[nodiscard]] bool solve_many(double* x, double* y, int count) override {
    return inner_.solve_many(x, y, count);
  }
  [[nodiscard]] bool solve_sparse(std::span<const Index> indices, std::span<const double> values,
                                  VectorRef x) override {
    return inner_.solve_sparse(indices, values, x);
  }
  [[nodiscard]] std::string_view name() const override { return "wrapped"; }
  [[nodiscard]] double flops() const override { return inner_.flops(); }
  [[nodiscard]] double bytes() const override { return inner_.bytes(); }

 protected:
  [[nodiscard]] bool factorize(const RowWeights& weights) override { return inner_.factor(weights); }

 private:
  Kkt& inner_;
};

/// Its factorization number `last` and all after it fail, after `stop` was asked to stop.
class FailingKkt final : public WrappedKkt {
 public:
  FailingKkt(Kkt& inner, int last, std::stop_source* stop = nullptr)
      : WrappedKkt(inner), left_(last - 1), stop_(stop) {}
  [[nodiscard]] bool factorize(const RowWeights& weights) override {
    if (left_-- > 0) return WrappedKkt::factorize(weights);
    if (stop_ != nullptr) stop_->request_stop();
    return false;
  }

 private:
  int left_;
  std::stop_source* stop_;
};

struct Workbench {
  explicit Workbench(const OwnedProblem& p, const Options& chosen = {}, Rows* reported = nullptr)
      : owned(p),
        options(chosen),
        controls{.progress = reported,
                 .stop = reported != nullptr ? reported->source.get_token() : std::stop_token()},
        problem(scale(Problem::create(owned.view()).value(), options.scaling_passes)),
        kkt(make_kkt(problem)),
        run(options, controls) {
    kkt->attend(run.interrupt());
  }
  Workbench(const Workbench&) = delete;
  Workbench& operator=(const Workbench&) = delete;

  [[nodiscard]] Vector zero() const { return Vector::Zero(problem.variables()); }
  /// In the user's units.
  [[nodiscard]] std::vector<double> user(ConstVectorRef z) const {
    const Vector unscaled = z.cwiseProduct(problem.variable_scale);
    return {unscaled.begin(), unscaled.end()};
  }
  /// The judge's word on z alone (scaled).
  [[nodiscard]] Verdict judged(ConstVectorRef z) const {
    Solution s;
    s.z = user(z);
    s.equality_multipliers.resize(owned.b.size());
    s.inequality_multipliers.resize(owned.d.size());
    s.complementarity_multipliers_L.resize(owned.l.size());
    s.complementarity_multipliers_R.resize(owned.r.size());
    return judge(owned.view(), s);
  }
  [[nodiscard]] Images images(const Iterate& x) const {
    Images result(problem);
    result.evaluate(problem, x);
    return result;
  }

  OwnedProblem owned;
  Options options;
  SolveControls controls;
  ScaledProblem problem;
  std::unique_ptr<Kkt> kkt;
  Run run;
};

/// min ½(x² + y²) over x ≥ 1 and y ≥ 1 with 0 ≤ x ⊥ y ≥ 0: every branch is empty.
[[nodiscard]] inline OwnedProblem without_feasible_branch() {
  OwnedProblem p;
  p.name = "without a feasible branch";
  p.g = {0.0, 0.0};
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {1.0, 1.0}}, "Q").value();
  p.C = p.Q;
  p.d = {-1.0, -1.0};
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

/// One variable z ≥ 1 and a pair 0 ≤ x ⊥ y ≥ 0, unscaled: (x, y, z).
[[nodiscard]] inline OwnedProblem row_and_pair() {
  OwnedProblem p;
  p.g = {0.0, 0.0, 0.0};
  p.Q = compress(3, 3, {{0, 1, 2}, {0, 1, 2}, {1.0, 1.0, 1.0}}, "Q").value();
  p.C = compress(1, 3, {{0}, {2}, {1.0}}, "C").value();
  p.d = {-1.0};
  p.L = compress(1, 3, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 3, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

}  // namespace marble::testing
