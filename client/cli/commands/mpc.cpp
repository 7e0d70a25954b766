// Runs a closed loop as a controller would: the first step of the plan is followed, and the next plan starts
// there.
#include <chrono>
#include <cstdio>
#include <iostream>
#include <memory>

#include "arguments/server_arguments.h"
#include "arguments/solver_arguments.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "base/median.h"
#include "commands/commands.h"
#include "marble/examples.h"
#include "output/json.h"

namespace marble::cli {
namespace {

struct MpcArguments {
  std::string problem;
  ServerArguments server;
  SolverArguments solver;
  Priority priority = Priority::by_method;
  int control_steps = 50;
  int steps = 60;
  std::uint64_t seed = 0;
  double deadline_s = 0.0;  // none
  bool cold = false;
  bool prepare = false;
  bool local = false;
};

int fails(const MpcArguments& arguments, const Error& error) {
  if (!arguments.local) return server_fails(arguments.server, error);
  complain(error.message());
  return exit_code_of_local(error);
}

struct ControlStep {
  RemoteSolution answer;
  double round_trip_ms = 0.0;
};

// Returns the vectors that differ; the matrices stay the same as the horizon moves.
ProblemUpdate difference(const OwnedProblem& before, const OwnedProblem& now) {
  ProblemUpdate update;
  const auto changed = [](const std::vector<double>& a, const std::vector<double>& b) {
    return a == b ? std::span<const double>() : std::span<const double>(b);
  };
  if (before.c0 != now.c0) update.c0 = now.c0;
  update.g = changed(before.g, now.g);
  update.b = changed(before.b, now.b);
  update.d = changed(before.d, now.d);
  update.l = changed(before.l, now.l);
  update.r = changed(before.r, now.r);
  update.A = changed(before.A.values, now.A.values);
  update.C = changed(before.C.values, now.C.values);
  return update;
}

// Sends the part that does not depend on the measured state ahead. The rest is sent in the control step.
Expected<void> prepare(Session& session, ProblemUpdate& update, UpdateControls& controls) {
  ProblemUpdate first = update;
  first.b = {};
  MARBLE_RETURN_IF_ERROR(session.prepare(first, controls));
  update = {.b = update.b};
  controls.shift = {};
  return {};
}

void report_step(const MpcArguments& arguments, int number, const ControlStep& step) {
  const RemoteSolution& s = step.answer;
  if (s.reopened) complain("the server was lost; the session was set up again as " + s.job_id);
  if (arguments.server.json()) {
    std::cout << line({{"step", number},
                       {"status", to_string(s.status)},
                       {"objective", s.objective},
                       {"iterations", s.iterations},
                       {"factorizations", s.factorizations},
                       {"solve_ms", 1e3 * s.times.solve_s},
                       {"round_trip_ms", step.round_trip_ms},
                       {"reopened", s.reopened}})
              << '\n'
              << std::flush;
    return;
  }
  if (number == 0)
    std::printf("%5s %-16s %6s %10s %14s %15s\n", "step", "status", "fact", "solve ms", "round trip ms",
                "objective");
  std::printf("%5d %-16s %6d %10.3f %14.3f %15.7e\n", number, to_string(s.status), s.factorizations,
              1e3 * s.times.solve_s, step.round_trip_ms, s.objective);
  std::fflush(stdout);
}

// Excludes the first control step, which has no solution to start from.
void report_summary(const MpcArguments& arguments, const Session& session,
                    const std::vector<ControlStep>& steps) {
  std::vector<double> factorizations, solve_ms, round_trip_ms;
  for (std::size_t i = 1; i < steps.size(); ++i) {
    factorizations.push_back(steps[i].answer.factorizations);
    solve_ms.push_back(1e3 * steps[i].answer.times.solve_s);
    round_trip_ms.push_back(steps[i].round_trip_ms);
  }
  const char* start = arguments.cold ? "cold" : "warm";
  if (arguments.server.json()) {
    std::cout << line({{"summary", start},
                       {"control_steps", solve_ms.size()},
                       {"job_id", session.job_id()},
                       {"median_factorizations", median(factorizations)},
                       {"median_solve_ms", median(solve_ms)},
                       {"median_round_trip_ms", median(round_trip_ms)},
                       {"setup_ms", 1e3 * session.setup_s()},
                       {"memory_bytes", session.memory_bytes()}})
              << '\n';
    return;
  }
  std::printf(
      "median of %zu %s control steps: %.1f factorizations, %.3f ms solve, %.3f ms round trip; set-up %.3f "
      "ms\n",
      solve_ms.size(), start, median(factorizations), median(solve_ms), median(round_trip_ms),
      1e3 * session.setup_s());
}

// A control step without a plan in time, which follows the last plan.
void report_missed(const MpcArguments& arguments, int number, const Error& error, double round_trip_ms) {
  if (arguments.server.json()) {
    std::cout << line({{"step", number},
                       {"status", "deadline_exceeded"},
                       {"detail", error.message()},
                       {"round_trip_ms", round_trip_ms}})
              << '\n'
              << std::flush;
    return;
  }
  std::printf("%5d %-16s %6s %10s %14.3f\n", number, "missed", "", "", round_trip_ms);
  std::fflush(stdout);
}

int run_loop(const MpcArguments& arguments, Session& session, examples::HopperParameters parameters,
             OwnedProblem problem) {
  int exit_code = kAllSolved;
  std::vector<ControlStep> steps;
  UpdateControls controls;
  controls.cold = arguments.cold;
  if (arguments.deadline_s > 0.0) controls.deadline = std::chrono::duration<double>(arguments.deadline_s);
  const Shift by_stage = Shift::by_stage(problem.view(), arguments.steps).value();
  std::vector<double> plan;
  ProblemUpdate update;
  OwnedProblem next;
  for (int number = 0; number <= arguments.control_steps; ++number) {
    UpdateControls of_step = controls;
    // The time between two control steps belongs to the controller.
    const auto prepared = arguments.prepare ? prepare(session, update, of_step) : Expected<void>();
    if (!prepared) return worse(exit_code, fails(arguments, prepared.error()));
    const auto begin = std::chrono::steady_clock::now();
    auto answer = session.solve(update, of_step);
    const std::chrono::duration<double, std::milli> round_trip = std::chrono::steady_clock::now() - begin;
    const bool missed = !answer && answer.error().code == ErrorCode::deadline_exceeded && !plan.empty();
    if (!answer && !missed) {
      report_summary(arguments, session, steps);
      const int outcome = exit_code_of(answer.error());
      static_cast<void>(fails(arguments, answer.error()));
      return worse(exit_code, outcome);
    }
    if (missed) {
      report_missed(arguments, number, answer.error(), round_trip.count());
      shift(by_stage.variables, plan);
      exit_code = kNotSolved;
    } else {
      steps.push_back({std::move(*answer), round_trip.count()});
      report_step(arguments, number, steps.back());
      if (!is_solved(steps.back().answer.status)) exit_code = kNotSolved;
      plan = steps.back().answer.z;
    }
    parameters = examples::advance(parameters, plan);
    next = examples::hopper(parameters);
    update = difference(problem, next);
    std::swap(problem, next);  // moves no array: the update still views the newer one
    if (!arguments.cold) controls.shift = by_stage;
  }
  report_summary(arguments, session, steps);
  return exit_code;
}

int run(const MpcArguments& arguments) {
  const auto options = parse_options(arguments.solver);
  if (!options) return option_fails(options.error());
  warn_of_idle_options(arguments.solver, *options);
  ServerArguments server = arguments.server;
  server.connect.keepalive = Keepalive::control_loop();
  const auto client = arguments.local ? Expected<Client>(Client::in_process()) : connect(server);
  if (!client) return fails(arguments, client.error());
  examples::HopperParameters parameters = examples::vary(examples::HopperParameters{}, arguments.seed);
  parameters.steps = arguments.steps;
  const OwnedProblem problem = examples::hopper(parameters);
  const Interrupt interrupt;
  SessionOptions wanted;
  wanted.priority = arguments.priority;
  wanted.initial_z = problem.initial_z;
  wanted.problem_name = problem.name;
  wanted.stop = interrupt.token();
  wanted.reopen = true;
  auto session = client->open_session(problem.view(), *options, wanted);
  if (!session) return fails(arguments, session.error());
  const int exit_code = run_loop(arguments, *session, parameters, problem);
  if (session->is_open()) static_cast<void>(session->close());  // every update has its solution
  return exit_code;
}

}  // namespace

void add_mpc(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<MpcArguments>();
  CLI::App* command = program.add_subcommand(
      "mpc", "Run an example in closed loop over a session: solve, apply the first step, solve again");
  command->add_option("NAME", arguments->problem, "hopper")->required()->check(CLI::IsMember({"hopper"}));
  add_server_arguments(*command, arguments->server);
  add_priority_argument(*command, arguments->priority);
  command
      ->add_flag("--local", arguments->local,
                 "solve in this process, without a server; the results are identical to the last bit")
      ->excludes(command->get_option("--server"));
  add_solver_arguments(*command, arguments->solver);
  command->add_option("--control-steps", arguments->control_steps, "number of control steps")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--steps", arguments->steps, "number of stages of the horizon")
      ->check(CLI::Range(2, 100000))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "seed of the problem's variation; 0 is the nominal problem")
      ->capture_default_str();
  command
      ->add_option(
          "--deadline", arguments->deadline_s,
          "latest useful time of a plan, in seconds; a control step without a plan in time follows the "
          "last one; default: none")
      ->check(CLI::Range(1e-6, 3600.0));
  command->add_flag("--cold", arguments->cold, "start every step cold, for comparison");
  command
      ->add_flag("--prepare", arguments->prepare,
                 "send the data that do not depend on the state ahead of each step (preparation phase); the "
                 "results are identical to the last bit")
      ->excludes(command->get_option("--cold"));
  command->footer(kExitCodes);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
