#include "kkt/kkt.h"

#include <algorithm>

#include "kkt/dense_kkt.h"
#include "kkt/sparse_kkt.h"
#include "model/tuning.h"

namespace marble {
namespace {

double condensed_work(const RowMatrix& matrix) {
  double work = 0.0;
  for (Index row = 0; row < matrix.rows; ++row)
    work += static_cast<double>(matrix.row_size(row)) * matrix.row_size(row);
  return work;
}

bool has_long_rows(const RowMatrix& matrix) {
  for (Index row = 0; row < matrix.rows; ++row) {
    if (SparseKkt::is_long_row(matrix.row_size(row), matrix.columns)) return true;
  }
  return false;
}

// Data this full would fill any sparse factor, so an analysis would only cost time.
bool nearly_full(const ScaledProblem& p) {
  const auto entries = [](const auto& matrix) { return static_cast<double>(matrix.values.size()); };
  const double n = p.variables();
  const double rows = 0.5 * n + p.equalities() + p.inequalities() + 2.0 * p.pairs();
  return entries(p.Q) + entries(p.A) + entries(p.rows) > tuning::nearly_full * rows * n;
}

}  // namespace

std::unique_ptr<Kkt> make_kkt(const ScaledProblem& p, const KktCost& most, const Interrupt& interrupt,
                              KktCost& least) {
  const KktCost dense{DenseKkt::estimated_bytes(p), DenseKkt::estimated_flops(p)};
  const bool dense_fits = dense.bytes <= most.bytes;
  least = {dense.bytes, dense_fits ? dense.flops : KktCost{}.flops};
  const auto allocated = [&](std::unique_ptr<Kkt> kkt) {
    kkt->attend(interrupt);
    return kkt->allocate(p) ? std::move(kkt) : nullptr;
  };
  const auto make_dense = [&]() -> std::unique_ptr<Kkt> {
    return dense.flops <= most.flops ? allocated(std::make_unique<DenseKkt>(p)) : nullptr;
  };
  if (dense_fits && (p.variables() <= tuning::tiny || nearly_full(p))) return make_dense();
  std::unique_ptr<Kkt> best;
  const auto consider = [&](KeptRows kept) {
    const double analysis = SparseKkt::analysis_bytes(p, kept);
    if (analysis > most.bytes) {
      least.bytes = std::min(least.bytes, analysis);
      return;
    }
    auto candidate = SparseKkt::analyse(p, kept, interrupt);
    if (candidate == nullptr) return;
    least.bytes = std::min(least.bytes, candidate->bytes());
    if (candidate->bytes() > most.bytes) return;
    least.flops = std::min(least.flops, candidate->flops());
    if (!best || candidate->flops() < best->flops()) best = std::move(candidate);
  };
  const double work = condensed_work(p.rows);
  if (work < std::min(tuning::condensing_work, 2.0 * dense.flops)) consider(KeptRows::none);
  if (has_long_rows(p.rows)) consider(KeptRows::dense);
  // The full form has more rows but less fill-in in each. Its analysis pays off if condensing filled in.
  const auto entries = static_cast<double>(p.Q.values.size() + p.A.values.size() + p.rows.values.size());
  if (!best || best->flops() > tuning::filled_in * entries) consider(KeptRows::all);
  if (interrupt.requested()) return nullptr;
  if (dense_fits && (!best || dense.flops < best->flops())) return make_dense();
  return best && best->flops() <= most.flops ? allocated(std::move(best)) : nullptr;
}

std::unique_ptr<Kkt> make_kkt(const ScaledProblem& problem, const Interrupt& interrupt) {
  KktCost least;
  return make_kkt(problem, {}, interrupt, least);
}

}  // namespace marble
