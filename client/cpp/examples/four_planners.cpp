// Four planners, each in its own process, share one server, which keeps a session for each and serves them in
// turns. The difference between the round trip and the solve is the time that a planner waits for the others.
//
// Usage: MARBLE_SERVER=HOST:PORT four_planners [PLANS]
#include <marble/client.h>
#include <marble/examples.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace {

int fails(int number, const marble::Error& error) {
  std::fprintf(stderr, "planner %d: %s\n", number, error.message().c_str());
  return 1;
}

int plan(int number, int plans) {
  marble::ConnectOptions who = marble::ConnectOptions::from_environment();
  who.name = "planner " + std::to_string(number);  // the server distinguishes clients by name, or by token
  const auto client = marble::Client::connect(marble::default_server_address(), who);
  if (!client) return fails(number, client.error());
  // Each has its own hopper.
  const auto seed = static_cast<std::uint64_t>(number);
  auto robot = marble::examples::vary(marble::examples::HopperParameters{.steps = 30}, seed);
  marble::OwnedProblem problem = marble::examples::hopper(robot);
  auto session = client->open_session(problem.view(), {}, {.initial_z = problem.initial_z});
  if (!session) return fails(number, session.error());

  const auto one_step_on = marble::Shift::by_stage(problem.view(), robot.steps);
  if (!one_step_on) return fails(number, one_step_on.error());

  std::vector<double> round_trips_ms;
  double solving_ms = 0.0;
  for (int i = 0; i < plans; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    const auto answer =
        session->solve({.c0 = problem.c0, .g = problem.g, .b = problem.b}, {.shift = *one_step_on});
    const std::chrono::duration<double, std::milli> round_trip = std::chrono::steady_clock::now() - begin;
    if (!answer) return fails(number, answer.error());
    round_trips_ms.push_back(round_trip.count());
    solving_ms += 1e3 * answer->times.solve_s;
    robot = marble::examples::advance(robot, answer->z);
    problem = marble::examples::hopper(robot);
  }
  std::sort(round_trips_ms.begin(), round_trips_ms.end());
  std::printf("planner %d: %d plans, round trip %.1f ms in the middle, %.1f ms at most, solve %.1f ms\n",
              number, plans, round_trips_ms[round_trips_ms.size() / 2], round_trips_ms.back(),
              solving_ms / plans);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const int plans = argc > 1 ? std::max(1, std::atoi(argv[1])) : 40;
  for (int number = 1; number <= 4; ++number) {
    const pid_t child = fork();  // before gRPC starts: it does not survive a fork
    if (child == 0) return plan(number, plans);
    if (child < 0) return std::perror("fork"), 1;
  }
  int worst = 0, status = 0;
  while (wait(&status) > 0) worst = std::max(worst, WIFEXITED(status) ? WEXITSTATUS(status) : 1);
  return worst;
}
