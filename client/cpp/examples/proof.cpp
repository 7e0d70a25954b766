// Plans a path through gates with a proof of optimality: incumbent and bound approach each other, and at the
// time limit the solution reports the remaining gap.
//
// Usage: proof [SECONDS]    default 10
#include <marble/client.h>
#include <marble/examples.h>

#include <cstdio>
#include <cstdlib>

namespace {

class Closing : public marble::ProgressSink {
 public:
  void report(const marble::Progress& row) override {
    if (row.nodes == 0 || (row.incumbent == incumbent_ && row.elapsed_s < reported_s_ + 0.5)) return;
    incumbent_ = row.incumbent;
    reported_s_ = row.elapsed_s;
    std::printf("%8.2f s %9lld nodes %14.6f %14.6f\n", row.elapsed_s, static_cast<long long>(row.nodes),
                row.incumbent, row.bound);
  }

 private:
  double incumbent_ = 0.0, reported_s_ = 0.0;
};

}  // namespace

int main(int count, char** words) {
  const marble::OwnedProblem problem = marble::examples::gates();
  marble::Options options;
  options.global_search = true;
  options.time_limit_s = count > 1 ? std::atof(words[1]) : 10.0;
  Closing closing;
  std::printf("%10s %15s %14s %14s\n", "time", "", "incumbent", "bound");
  const auto answer = marble::solve(problem.view(), options, {.progress = &closing});
  if (!answer) {
    std::fprintf(stderr, "%s\n", answer.error().message().c_str());
    return 1;
  }
  std::printf("%s: objective %.6f, %s (gap %.1e, %lld nodes)\n", marble::to_string(answer->status),
              answer->objective, answer->proved ? "proved optimal" : "not proved", answer->gap,
              static_cast<long long>(answer->nodes));
  return 0;
}
