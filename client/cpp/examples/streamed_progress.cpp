// Streams the progress of a solve while this program does something else. Ctrl-C cancels the solve, and the
// server stops within one iteration.
#include <marble/client.h>
#include <marble/examples.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>

namespace {

volatile std::sig_atomic_t interrupted = 0;

// Called on a thread of the client, once per iteration.
class Table : public marble::ProgressSink {
 public:
  void report(const marble::Progress& row) override {
    const marble::Violations& v = row.violations;
    const double violation = std::max({v.equality, v.inequality, v.complementarity});
    std::printf("%9d %15.6f %10.1e %10.1e\n", row.iteration, row.objective, violation, row.kappa);
  }
};

}  // namespace

int main() {
  std::signal(SIGINT, [](int) { interrupted = 1; });
  const auto client = marble::Client::connect();  // the server that MARBLE_SERVER names
  if (!client) {
    std::fprintf(stderr, "%s\n", client.error().message().c_str());
    return 1;
  }
  std::printf("%9s %15s %10s %10s\n", "iteration", "objective", "violation", "kappa");
  const marble::OwnedProblem problem = marble::examples::rocket();
  Table table;
  auto pending = client->solve_async(problem.view(), {}, {.progress = &table});
  if (!pending) {
    std::fprintf(stderr, "%s\n", pending.error().message().c_str());
    return 1;
  }
  while (!pending->wait_for(std::chrono::milliseconds(5))) {  // a planner would do its other work here
    if (interrupted) pending->cancel();
  }
  const auto answer = pending->get();
  if (!answer) {
    std::fprintf(stderr, "%s\n", answer.error().message().c_str());
    return 1;
  }
  std::printf("%s in %.1f ms: %s\n", marble::to_string(answer->status), 1e3 * answer->times.solve_s,
              answer->detail.c_str());
  return marble::is_solved(answer->status) ? 0 : 1;
}
