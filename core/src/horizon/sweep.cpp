#include "horizon/sweep.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "horizon/window.h"
#include "model/entries.h"
#include "model/tuning.h"
#include "path/run.h"

namespace marble {
namespace {

double objective(const ProblemView& p, const std::vector<double>& z) {
  double sum = p.c0;
  for (std::size_t j = 0; j < z.size(); ++j) sum += p.g[j] * z[j];
  const bool upper = p.hessian_form == HessianForm::upper_triangle;
  for_entries(p.Q, [&](Index i, Index j, double value) {
    sum += (upper && i != j ? 1.0 : 0.5) * value * z[at(i)] * z[at(j)];
  });
  return sum;
}

class Sweep {
 public:
  Sweep(const Problem& problem, const SweepPlan& plan, const Options& options, const SolveControls& controls,
        const SetupControls& setup)
      : p_(problem.view()),
        plan_(plan),
        options_(options),
        controls_(controls),
        setup_(setup),
        interrupt_(interrupt_of(controls, options)),
        window_(p_, plan.stage_of_variable) {
    whole_.z.assign(p_.g.size(), 0.0);
    whole_.equality_multipliers.assign(p_.b.size(), 0.0);
    whole_.inequality_multipliers.assign(p_.d.size(), 0.0);
    whole_.complementarity_multipliers_L.assign(p_.l.size(), 0.0);
    whole_.complementarity_multipliers_R.assign(p_.l.size(), 0.0);
  }

  [[nodiscard]] Expected<Solution> run();

 private:
  using End = Window::End;
  [[nodiscard]] Index start_of(std::size_t k) const { return k > 0 ? plan_.ends[k - 1] : 0; }
  [[nodiscard]] Index ahead(std::size_t k) const {
    return plan_.overlap >= 0 ? plan_.overlap : std::max(2, (plan_.ends[k] - start_of(k)) / 3);
  }
  [[nodiscard]] Index end_of(std::size_t k) const {
    return plan_.ends[k] + std::min(ahead(k), plan_.ends.back() - plan_.ends[k]);
  }
  [[nodiscard]] bool ended(std::size_t k);
  [[nodiscard]] Expected<Solution> solve(const OwnedProblem& part, const Solution* start);
  [[nodiscard]] Expected<void> go_forward();
  [[nodiscard]] Expected<void> improve();
  void show(std::size_t done, int pass) const;

  ProblemView p_;
  const SweepPlan& plan_;
  const Options& options_;
  const SolveControls& controls_;
  const SetupControls& setup_;
  Interrupt interrupt_;
  Window window_;
  Solution whole_;
};

// True if a stop or the time limit came before segment k.
bool Sweep::ended(std::size_t k) {
  if (!interrupt_.requested()) return false;
  whole_.status = interrupt_.stop_requested() ? Status::cancelled : Status::time_limit;
  whole_.detail = "ended at segment " + std::to_string(k);
  return true;
}

void Sweep::show(std::size_t done, int pass) const {
  if (controls_.activity == nullptr) return;
  const auto segments = std::ssize(plan_.ends);
  controls_.activity->set_done(Phase::local_search, pass * segments + static_cast<std::int64_t>(done),
                               (1 + plan_.passes) * segments);
}

Expected<Solution> Sweep::solve(const OwnedProblem& part, const Solution* start) {
  MARBLE_ASSIGN_OR_RETURN(const auto checked, Problem::create(part.view()));
  MARBLE_ASSIGN_OR_RETURN(auto answer, solve_once(checked, options_,
                                                  {.stop = controls_.stop,
                                                   .warm_start = start,
                                                   .runner = controls_.runner,
                                                   .pause = controls_.pause,
                                                   .begun = controls_.begun},
                                                  setup_));
  whole_.factorizations += answer.factorizations;
  whole_.times += answer.times;
  return answer;
}

Expected<void> Sweep::go_forward() {
  whole_.status = Status::solved;
  Index first = 0;  // of the undecided stages
  for (std::size_t k = 0; k < plan_.ends.size();) {
    if (ended(k)) return {};
    const auto part = window_.problem(first, end_of(k), End::open, whole_.z, interrupt_);
    if (ended(k)) return {};
    if (!part) return unexpected(part.error());
    MARBLE_ASSIGN_OR_RETURN(const auto answer, solve(*part, nullptr));
    if (!is_solved(answer.status)) {
      if (ended(k)) return {};
      if (k > 0 && first == start_of(k)) {
        first = start_of(k - 1);
        continue;
      }
      whole_.status = answer.status;
      whole_.detail = "segment " + std::to_string(k) + ", from where the last one ended: " + answer.detail;
      return {};
    }
    window_.take(answer, plan_.ends[k], whole_);
    first = plan_.ends[k++];
    show(k, 0);
  }
  whole_.objective = objective(p_, whole_.z);
  return {};
}

// Keeps the current values where a pass finds nothing better.
Expected<void> Sweep::improve() {
  for (int pass = 1; pass <= plan_.passes; ++pass) {
    const double before = whole_.objective;
    for (std::size_t k = 0; k < plan_.ends.size(); ++k) {
      const Index first = std::max(0, start_of(k) - ahead(k));
      const auto part = window_.problem(first, end_of(k), End::known, whole_.z, interrupt_);
      if (interrupt_.requested()) return {};
      if (!part) return unexpected(part.error());
      Solution start = window_.part_of(whole_);
      start.reference_objective = std::numeric_limits<double>::max();
      MARBLE_ASSIGN_OR_RETURN(const auto answer, solve(*part, &start));
      if (is_solved(answer.status) && answer.objective <= objective(part->view(), start.z))
        window_.take(answer, plan_.ends.back(), whole_);
      show(k + 1, pass);
    }
    whole_.objective = objective(p_, whole_.z);
    if (before - whole_.objective <= tuning::sweep_gain * std::abs(whole_.objective)) break;
  }
  return {};
}

Expected<Solution> Sweep::run() {
  MARBLE_RETURN_IF_ERROR(go_forward());
  if (!is_solved(whole_.status)) return whole_;
  MARBLE_RETURN_IF_ERROR(improve());
  return whole_;
}

}  // namespace

Expected<Solution> sweep(const Problem& problem, const SweepPlan& plan, const Options& options,
                         const SolveControls& controls, const SetupControls& setup) {
  return Sweep(problem, plan, options, controls, setup).run();
}

}  // namespace marble
