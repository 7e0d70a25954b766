// The hopper in closed loop: plan two seconds ahead, follow the first 50 ms, plan again from there. The
// problem stays on the server in a session; a control step sends the vectors that changed and starts from the
// last plan, shifted by one step. Writes an animated picture at the end.
//
// Usage: hopper_mpc [TICKS [PICTURE.svg]]
#include <marble/client.h>
#include <marble/examples.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "hopper_picture.h"

namespace {

int fails(const marble::Error& error) {
  std::fprintf(stderr, "%s\n", error.message().c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  const int ticks = argc > 1 ? std::atoi(argv[1]) : 70;
  const char* const picture = argc > 2 ? argv[2] : "hopper.svg";

  marble::examples::HopperParameters robot{.steps = 40};
  marble::OwnedProblem problem = marble::examples::hopper(robot);
  const auto client = marble::Client::connect();  // the server that MARBLE_SERVER names
  if (!client) return fails(client.error());
  // If the server dies, the session is opened again on another one of MARBLE_SERVER's list.
  auto session = client->open_session(problem.view(), {}, {.initial_z = problem.initial_z, .reopen = true});
  if (!session) return fails(session.error());
  const auto one_step_on = marble::Shift::by_stage(problem.view(), robot.steps);
  if (!one_step_on) return fails(one_step_on.error());

  std::vector<Tick> way;
  std::printf("%4s %-14s %14s %13s %8s\n", "tick", "status", "factorizations", "round trip ms", "body x m");
  for (int tick = 0; tick < ticks; ++tick) {
    const auto begin = std::chrono::steady_clock::now();
    const auto plan =
        session->solve({.c0 = problem.c0, .g = problem.g, .b = problem.b}, {.shift = *one_step_on});
    const std::chrono::duration<double, std::milli> round_trip = std::chrono::steady_clock::now() - begin;
    if (!plan) return fails(plan.error());
    std::printf("%4d %-14s %14d %13.2f %8.3f%s\n", tick, marble::to_string(plan->status),
                plan->factorizations, round_trip.count(), robot.position[0],
                plan->reopened ? "  (server lost, session set up again)" : "");
    way.push_back({robot.position, plan->z});
    robot = marble::examples::advance(robot, plan->z);
    problem = marble::examples::hopper(robot);
  }
  std::ofstream file(picture);
  file << draw(robot, way);
  file.close();
  if (!file) return std::fprintf(stderr, "%s: cannot be written\n", picture), 1;
  std::printf("%s: %d ticks of %.0f ms\n", picture, ticks, 1e3 * robot.step_s);
  return 0;
}
