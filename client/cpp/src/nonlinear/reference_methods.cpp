// Runs the method of a given name. For the references, runs the outer loop, which changes weights and
// multipliers until the minimum of their function passes the tests of the main loop's solutions.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "nonlinear/algebra.h"
#include "nonlinear/auxiliary.h"
#include "nonlinear/sqpcc.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {
namespace {

class Reference {
 public:
  Reference(const Problem& problem, Functions functions, Point first, const OpenTicks& open,
            const Settings& settings)
      : settings_(settings),
        inner_(settings),
        functions_(std::move(functions)),
        auxiliary_(problem, functions_, settings, std::move(first)),
        open_(open) {
    inner_.method = Method::sqpcc;
    inner_.curvature = Curvature::exact;
    if (settings.iteration) inner_.iteration = [this](const Iteration& row) { report(row); };
  }

  Expected<Answer> run() {
    MARBLE_ASSIGN_OR_RETURN(auto own, Functions::create(auxiliary_.problem()));
    Loop loop(auxiliary_.problem(), std::move(own), open_, inner_);
    loop.set_stationary(kReducedKkt);  // slopes of large weights leave no more digits
    for (auxiliary_.set_weight(mu_);;) {
      inner_.iteration_limit = settings_.iteration_limit - iterations_;
      if (is_barrier()) inner_.step_tolerance = std::min(settings_.step_tolerance, tuning::fine_step * mu_);
      auto minimum = loop.run();
      if (!minimum) {
        const bool of_functions = minimum.error().code == ErrorCode::invalid_argument && auxiliary_.fault();
        return unexpected(of_functions ? *auxiliary_.fault() : minimum.error());
      }
      iterations_ += minimum->iterations;
      judge(*minimum);
      if (!is_solved(minimum->status))
        return end(*minimum, minimum->status, "the auxiliary function's loop ended");
      if (meets_tests(*minimum)) return end(*minimum, minimum->status, "the auxiliary function's minimum");
      if (!go_on()) return end(*minimum, Status::numerical_failure, "the weights are at their limit");
    }
  }

 private:
  [[nodiscard]] bool is_barrier() const { return settings_.method == Method::barrier; }

  // Converts the minimum to a solution of the caller's problem.
  void judge(Answer& minimum) {
    const Point& point = auxiliary_.at(minimum.x);
    auxiliary_.multipliers(minimum.x, settings_.feasibility_tolerance, minimum.multipliers);
    lagrangian_gradient(auxiliary_.linearisation(), minimum.multipliers, gradient_);
    for (std::size_t j = 0; j < gradient_.size(); ++j) gradient_[j] -= minimum.multipliers.bounds[j];
    minimum.kkt_residual = largest(gradient_);
    minimum.objective = point.objective, minimum.violation = auxiliary_.violation();
  }

  [[nodiscard]] bool meets_tests(const Answer& minimum) const {
    return minimum.violation <= settings_.feasibility_tolerance &&
           minimum.kkt_residual <=
               kReducedKkt * largest_slope(auxiliary_.linearisation(), minimum.multipliers) &&
           (!is_barrier() || mu_ * std::abs(auxiliary_.barrier()) < settings_.feasibility_tolerance);
  }

  bool go_on() {
    if (settings_.method == Method::alag) return correct_multipliers();
    if (mu_ >= tuning::most_mu || mu_ <= 1.0 / tuning::most_mu) return false;
    mu_ *= is_barrier() ? 1.0 / tuning::growth : tuning::growth;
    auxiliary_.set_weight(mu_);
    return true;
  }

  // If the residuals have fallen to a quarter, updates π; else the weights of the rows still above it.
  bool correct_multipliers() {
    double worst = 0.0;
    over_rows(
        [&](auto part, std::size_t i, auto&) { worst = std::max(worst, auxiliary_.residual(part, i)); });
    const double wanted = tuning::multiplier_progress * std::exchange(worst_, worst);
    bool good = true;
    over_rows([&](auto part, std::size_t i, Auxiliary::Row& row) {
      if (worst <= wanted) {
        row.multiplier = auxiliary_.estimate(part, i);
      } else if (auxiliary_.residual(part, i) > wanted) {
        good &= row.weight < tuning::most_mu;
        if (good) row.weight *= tuning::growth;
      }
    });
    return good;
  }

  template <class Do>
  void over_rows(const Do& what) {
    for (std::size_t part = 0; part < Auxiliary::kParts; ++part)
      for (std::size_t i = 0; i < auxiliary_.rows()[part].size(); ++i)
        what(static_cast<Auxiliary::Part>(part), i, auxiliary_.rows()[part][i]);
  }

  Answer end(Answer& answer, Status status, const std::string& why) {
    answer.status = status;
    answer.iterations = iterations_, answer.evaluations = functions_.evaluations();
    answer.b_stationary.reset(),
        answer.stationarity = Stationarity::unknown;  // those were of a problem without rows
    double weight = mu_;
    over_rows([&](auto, std::size_t, const Auxiliary::Row& row) { weight = std::max(weight, row.weight); });
    char text[200];
    std::snprintf(text, sizeof text, ": weight %.0e, violation %.1e, KKT residual %.1e after %d LCQPs",
                  is_barrier() ? mu_ : weight, answer.violation, answer.kkt_residual, answer.ticks);
    answer.detail = why + text + (is_solved(status) ? "" : "; " + answer.detail);
    return std::move(answer);
  }

  void report(Iteration row) {
    const Auxiliary::Seen& seen = auxiliary_.seen(row.x);
    row.objective = seen.objective, row.violation = seen.violation, row.iteration += iterations_;
    settings_.iteration(row);
  }

  const Settings& settings_;
  Settings inner_;
  Functions functions_;
  Auxiliary auxiliary_;
  const OpenTicks& open_;
  double mu_ = tuning::first_weight, worst_ = 0.0;
  std::int32_t iterations_ = 0;
  std::vector<double> gradient_;
};

Expected<Answer> solve_reference(const Problem& problem, Functions functions, const OpenTicks& open,
                                 const Settings& settings) {
  Point first;
  first.x.assign(functions.start().begin(), functions.start().end());
  MARBLE_RETURN_IF_ERROR(functions.values(first));
  try {
    return Reference(problem, std::move(functions), std::move(first), open, settings).run();
  } catch (Refused& refused) {
    return unexpected(std::move(refused.error));
  }
}

}  // namespace

Expected<Method> method_of(std::string_view name) {
  constexpr std::pair<std::string_view, Method> kMethods[] = {{"sqpcc", Method::sqpcc},
                                                              {"slp", Method::slp},
                                                              {"penalty", Method::penalty},
                                                              {"alag", Method::alag},
                                                              {"barrier", Method::barrier}};
  for (const auto& [word, method] : kMethods)
    if (name == word) return method;
  return unexpected(
      invalid("nonlinear_method", std::string(name), "must be sqpcc, slp, penalty, alag or barrier"));
}

Expected<Answer> solve(const Problem& problem, const OpenTicks& open, const Settings& settings) {
  MARBLE_RETURN_IF_ERROR(check(settings));
  MARBLE_ASSIGN_OR_RETURN(auto functions, Functions::create(problem));
  return or_out_of_memory([&] {
    return is_reference(settings.method) ? solve_reference(problem, std::move(functions), open, settings)
                                         : Loop(problem, std::move(functions), open, settings).run();
  });
}

}  // namespace marble::nonlinear
