// Plans the motion of a pendulum with a stop by sequential LCQPs: a weak motor moves it against a stop at 1
// rad, through a swing to the other side. Stage k has four variables: angle, speed, torque and contact force
// of the stop.
//
//   w' = w + h (u − 10 sin a' − f),   a' = a + h w',   0 ≤ f ⊥ 1 − a' ≥ 0,   |u| ≤ 4
#include <marble/client.h>
#include <marble/nonlinear.h>

#include <cmath>
#include <cstdio>
#include <vector>

namespace {

using marble::Index;

constexpr Index kStages = 30;
constexpr double kStep = 0.05, kGravity = 10.0, kStop = 1.0, kTorque = 4.0, kGoal = 5000.0;
enum Part : Index { kAngle, kSpeed, kMotor, kForce, kParts };

Index at(Index stage, Part part) { return kParts * stage + part; }

// One row per stage in G and H, two in the equalities; the patterns are constant, only the cosines change.
class Pendulum {
 public:
  Pendulum() : gradient_(kVariables), equalities_(2 * kStages), gap_(kStages), force_(kStages) {
    // Sets the constant entries.
    marble::Triplets motion, gap, force, hessian;
    for (Index k = 0; k < kStages; ++k) {
      motion.add(2 * k, at(k, kSpeed), 1.0), motion.add(2 * k, at(k, kAngle), 1.0);  // the second varies
      motion.add(2 * k, at(k, kMotor), -kStep), motion.add(2 * k, at(k, kForce), kStep);
      motion.add(2 * k + 1, at(k, kAngle), 1.0), motion.add(2 * k + 1, at(k, kSpeed), -kStep);
      if (k > 0) motion.add(2 * k, at(k - 1, kSpeed), -1.0), motion.add(2 * k + 1, at(k - 1, kAngle), -1.0);
      gap.add(k, at(k, kAngle), -1.0), force.add(k, at(k, kForce), 1.0);
      for (const Part part : {kAngle, kSpeed, kMotor}) hessian.add(at(k, part), at(k, part), 1.0);
    }
    motion_ = marble::compress(2 * kStages, kVariables, motion, "motion").value();
    gaps_ = marble::compress(kStages, kVariables, gap, "gap").value();
    forces_ = marble::compress(kStages, kVariables, force, "force").value();
    hessian_ = marble::compress(kVariables, kVariables, hessian, "hessian").value();
  }

  marble::nonlinear::Problem problem() {
    marble::nonlinear::Problem p;
    p.values = [this](auto x) { return values(x); };
    p.derivatives = [this](auto x) { return derivatives(x); };
    p.hessian = [this](auto x, const auto& multipliers) { return hessian(x, multipliers); };
    p.start.assign(kVariables, 0.0);
    p.lower.assign(kVariables, -HUGE_VAL), p.upper.assign(kVariables, HUGE_VAL);
    for (Index k = 0; k < kStages; ++k) p.lower[at(k, kMotor)] = -kTorque, p.upper[at(k, kMotor)] = kTorque;
    return p;
  }

 private:
  static constexpr Index kVariables = kParts * kStages, kLast = kStages - 1;

  marble::nonlinear::Values values(std::span<const double> x) {
    double cost =
        0.5 * kGoal * (std::pow(x[at(kLast, kAngle)] - kStop, 2) + std::pow(x[at(kLast, kSpeed)], 2));
    for (Index k = 0; k < kStages; ++k) {
      const double angle = x[at(k, kAngle)], speed = x[at(k, kSpeed)], u = x[at(k, kMotor)],
                   f = x[at(k, kForce)];
      const double angle_before = k > 0 ? x[at(k - 1, kAngle)] : 0.0,
                   speed_before = k > 0 ? x[at(k - 1, kSpeed)] : 0.0;
      cost += 0.5 * kStep * u * u;
      equalities_[2 * k] = speed - speed_before - kStep * (u - kGravity * std::sin(angle) - f);
      equalities_[2 * k + 1] = angle - angle_before - kStep * speed;
      gap_[k] = kStop - angle, force_[k] = f;
    }
    return {.objective = cost, .equalities = equalities_, .G = gap_, .H = force_};
  }

  marble::nonlinear::Derivatives derivatives(std::span<const double> x) {
    for (Index k = 0; k < kStages; ++k) {
      gradient_[at(k, kMotor)] = kStep * x[at(k, kMotor)];
      // The first entry of the column belongs to row 2k.
      motion_.values[motion_.column_pointers[at(k, kAngle)]] = kStep * kGravity * std::cos(x[at(k, kAngle)]);
    }
    gradient_[at(kLast, kAngle)] = kGoal * (x[at(kLast, kAngle)] - kStop);
    gradient_[at(kLast, kSpeed)] = kGoal * x[at(kLast, kSpeed)];
    return {.gradient = gradient_, .equalities = motion_.view(), .G = gaps_.view(), .H = forces_.view()};
  }

  marble::SparseMatrixView hessian(std::span<const double> x,
                                   const marble::nonlinear::Multipliers& multipliers) {
    auto* entry = hessian_.values.data();
    for (Index k = 0; k < kStages; ++k) {
      const double goal = k == kLast ? kGoal : 0.0;
      *entry++ = goal - multipliers.equalities[2 * k] * kStep * kGravity * std::sin(x[at(k, kAngle)]);
      *entry++ = goal, *entry++ = kStep;
    }
    return hessian_.view();
  }

  std::vector<double> gradient_, equalities_, gap_, force_;
  marble::SparseMatrix motion_, gaps_, forces_, hessian_;
};

}  // namespace

int main() {
  const auto client = marble::Client::connect();  // MARBLE_SERVER=local: in this process
  if (!client) return std::puts(client.error().message().c_str()), 1;
  Pendulum pendulum;
  const marble::nonlinear::Problem problem = pendulum.problem();
  if (const auto agree =
          marble::nonlinear::check_derivatives(problem, std::vector<double>(problem.start.size(), 0.3));
      !agree)
    return std::puts(agree.error().message().c_str()), 1;

  marble::nonlinear::Settings settings;
  settings.iteration = [](const marble::nonlinear::Iteration& row) {
    std::printf("%3d  cost %9.4f  violation %.1e  step %.1e%s\n", row.iteration, row.objective, row.violation,
                row.step, row.accepted ? "" : "  too long");
  };
  const auto plan = marble::nonlinear::solve(problem, *client, settings);
  if (!plan) return std::puts(plan.error().message().c_str()), 1;
  double back = 0.0, push = 0.0;
  for (Index k = 0; k < kStages; ++k)
    back = std::min(back, plan->x[at(k, kAngle)]), push = std::max(push, plan->x[at(k, kForce)]);
  std::printf("%s in %d LCQPs: back to %.3f rad, then to %.3f rad, the stop pushes with up to %.2f\n",
              to_string(plan->status), plan->ticks, back, plan->x[at(kStages - 1, kAngle)], push);
  std::printf("no first-order descent is left: %s\n",
              plan->b_stationary.value_or(false) ? "yes" : "not known");
}
