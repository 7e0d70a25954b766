#include "global/explain.h"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "global/refutation.h"

namespace marble {
namespace {

class Explanation {
 public:
  Explanation(const Problem& problem, const Options& options, const SolveControls& controls,
              const SetupControls& setup)
      : refutation_(problem, options, controls, setup),
        activity_(controls.activity),
        parts_(static_cast<std::size_t>(refutation_.numbers().size()), 1),
        needed_(parts_.size(), 0) {}

  /// Returns how the refutation of all parts together ends, and reduces the parts.
  [[nodiscard]] Refutation::End reduce(std::span<const double> certificate);
  [[nodiscard]] Conflict conflict() const;
  /// Returns (y, ν, ξ, η) of its rows alone if it needs no complementarity; otherwise empty.
  [[nodiscard]] std::vector<double> certificate();
  [[nodiscard]] const LinearRows& work() const { return refutation_.rows(); }

 private:
  [[nodiscard]] Refutation::End refute_all(std::span<const double> certificate);
  void drop(Index first, Index end);
  void show() const;

  Refutation refutation_;
  ActivityMonitor* activity_;
  Parts parts_;   // refuted together, or proved infeasible by the solve
  Parts needed_;  // without any of these parts, the others have a point
  bool undecided_ = false;
};

void Explanation::show() const {
  if (activity_ == nullptr) return;
  activity_->set_done(Phase::conflict, std::ranges::count(needed_, 1), std::ranges::count(parts_, 1));
}

// Tries the rows of a certificate first: they need no tree.
Refutation::End Explanation::refute_all(std::span<const double> certificate) {
  if (!certificate.empty()) {
    Parts some(parts_.size(), 0);
    for (std::size_t row = 0; row < certificate.size(); ++row) some[row] = certificate[row] != 0.0 ? 1 : 0;
    if (refutation_.run(some) == Refutation::End::refuted) return Refutation::End::refuted;
  }
  return refutation_.run(parts_);
}

// If the rest is refuted without a part, the conflict becomes smaller. If the rest has a point, the part
// remains needed after others are removed.
void Explanation::drop(Index first, Index end) {
  for (Index part = first; part < end && !refutation_.is_over(); ++part) {
    const auto at = static_cast<std::size_t>(part);
    if (parts_[at] == 0 || needed_[at] != 0) continue;
    Parts rest = parts_;
    rest[at] = 0;
    switch (refutation_.run(rest)) {
      case Refutation::End::refuted:
        parts_ = refutation_.support();
        break;
      case Refutation::End::feasible:
        needed_[at] = 1;
        break;
      case Refutation::End::undecided:
        undecided_ = true;
        break;
    }
    show();
  }
}

// Drops complementarities first and sides next: a conflict that needs neither is easier to understand, and
// cheaper to refute.
Refutation::End Explanation::reduce(std::span<const double> certificate) {
  const PhaseScope phase(activity_, Phase::conflict);
  const Refutation::End end = refute_all(certificate);
  if (end != Refutation::End::refuted) return end;
  parts_ = refutation_.support();
  show();
  const PartNumbers& numbers = refutation_.numbers();
  drop(numbers.complementarity(0), numbers.size());
  drop(numbers.first_side, numbers.complementarity(0));
  drop(0, numbers.first_side);
  return end;
}

Conflict Explanation::conflict() const {
  Conflict conflict;
  const PartNumbers& numbers = refutation_.numbers();
  const auto take = [this](Index first, Index count, std::vector<Index>& into) {
    for (Index k = 0; k < count; ++k) {
      if (parts_[static_cast<std::size_t>(first + k)] != 0) into.push_back(k);
    }
  };
  const Index equalities = work().problem().equalities();
  take(0, equalities, conflict.equalities);
  take(equalities, numbers.first_side - equalities, conflict.inequalities);
  take(numbers.s(0), numbers.pairs, conflict.left_sides);
  take(numbers.t(0), numbers.pairs, conflict.right_sides);
  take(numbers.complementarity(0), numbers.pairs, conflict.complementarities);
  conflict.minimal = parts_ == needed_;
  conflict.linear_programs = work().programs();
  conflict.factorizations = work().factorizations();
  if (conflict.minimal) {
    conflict.detail = "minimal: without any one of its parts the others have a point";
  } else {
    conflict.detail = "not minimal: ";
    conflict.detail += refutation_.interrupt().stop_requested() ? "stopped"
                       : refutation_.interrupt().requested()    ? "the time was up"
                       : refutation_.is_over()                  ? "its limit of nodes was reached"
                                                                : "not every smaller set could be decided";
  }
  conflict.detail += "; " + std::to_string(conflict.linear_programs) + " linear programs, " +
                     std::to_string(conflict.factorizations) + " factorizations";
  return conflict;
}

std::vector<double> Explanation::certificate() {
  const PartNumbers& numbers = refutation_.numbers();
  const auto rows = static_cast<std::size_t>(work().rows());
  if (std::any_of(parts_.begin() + static_cast<std::ptrdiff_t>(rows), parts_.end(),
                  [](std::uint8_t part) { return part != 0; }))
    return {};
  const Index equalities = work().problem().equalities();
  std::vector<HeldRow> held;
  for (Index row = 0; row < numbers.complementarity(0); ++row) {
    if (parts_[static_cast<std::size_t>(row)] != 0) held.push_back({row, row < equalities});
  }
  LinearRows& programs = refutation_.rows();
  if (programs.decide(held) != LinearRows::End::contradiction) return {};
  std::vector<double> stacked(rows, 0.0);
  for (std::size_t k = 0; k < held.size(); ++k) {
    const double multiplier = programs.multipliers()[k];
    stacked[static_cast<std::size_t>(held[k].row)] = held[k].equality ? multiplier : 0.0 - multiplier;
  }
  return stacked;
}

// Returns the text for a solution without a conflict.
const char* why_none(bool proved, Refutation::End end) {
  if (end != Refutation::End::feasible) return "; explain: no proof that it is infeasible was found";
  return proved ? "; explain: a point meets the tolerances: the constraints contradict each other by less"
                : "; explain: it is not infeasible, a feasible point was found: start elsewhere";
}

}  // namespace

void explain(const Problem& problem, const Options& options, const SolveControls& controls,
             const SetupControls& setup, Solution& solution) {
  const bool proved = solution.status == Status::infeasible;
  if (!proved && solution.status != Status::locally_infeasible) return;
  const auto begun = Interrupt::now(controls.pause);
  Explanation explanation(problem, options, controls, setup);
  const Refutation::End end = explanation.reduce(proved ? solution.certificate : std::span<const double>());
  const bool found = end == Refutation::End::refuted || (proved && end == Refutation::End::undecided);
  if (found) {
    if (std::vector<double> own = explanation.certificate(); !own.empty())
      solution.certificate = std::move(own);
    solution.conflict = explanation.conflict();
  } else {
    solution.detail += why_none(proved, end);
  }
  const LinearRows& work = explanation.work();
  solution.factorizations += work.factorizations();
  solution.iterations += work.iterations();
  Times times = work.times();
  times.setup_s = 0.0;
  times.solve_s = std::chrono::duration<double>(Interrupt::now(controls.pause) - begun).count();
  solution.times += times;
  if (proved || end != Refutation::End::refuted) return;
  solution.status = Status::infeasible;
  solution.proved = true;
  solution.bound = std::numeric_limits<double>::infinity();
  solution.gap = std::numeric_limits<double>::infinity();
  solution.detail =
      "proved by its conflict: every branch of the pairs contradicts the constraints; " + solution.detail;
}

}  // namespace marble
