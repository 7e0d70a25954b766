// Simulates a server with its clients for some hours, once for each seed; a seed replays its run bit for bit.
#include <sys/mman.h>
#include <sys/personality.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>

#include "environment.h"

using namespace marble::simulation;

namespace {

constexpr const char* kUsage =
    "Usage: simulation [--seed N] [--seeds COUNT] [--hours H] [--seconds S]\n"
    "  --seed N       the first seed; otherwise 1\n"
    "  --seeds COUNT  that many seeds, one after the other; otherwise 1\n"
    "  --hours H      simulated hours of each; otherwise 1\n"
    "  --seconds S    begins no seed after S seconds\n"
    "  --twice 1      runs each seed twice, and fails if the runs differ\n"
    "Prints a line for each seed. The exit status is 1 if a seed violates what the server promises; its last "
    "events\n"
    "are printed, and the same seed shows them again.\n";

// One seed in a process of its own: a killed server's threads stay where they are. Writes the run's digest.
int simulate_alone(std::uint64_t seed, double hours, std::uint64_t* digest) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    char folder[] = "/dev/shm/marble-simulation-XXXXXX";
    if (mkdtemp(folder) == nullptr) _exit(2);
    Outcome outcome;
    const auto begin = std::chrono::steady_clock::now();
    simulate(Plan::drawn(seed, hours), folder, outcome);
    const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    std::printf(
        "seed %llu: %.2f h in %.1f s (%.0f x), %lld calls, %lld jobs, %lld solves, %lld crashes, %lld stops, "
        "%lld hand-overs, %016llx\n",
        static_cast<unsigned long long>(seed), outcome.hours, took, outcome.hours * 3600.0 / took,
        static_cast<long long>(outcome.calls), static_cast<long long>(outcome.jobs),
        static_cast<long long>(outcome.solves), static_cast<long long>(outcome.crashes),
        static_cast<long long>(outcome.stops), static_cast<long long>(outcome.hand_overs),
        static_cast<unsigned long long>(outcome.digest));
    std::fflush(nullptr);
    *digest = outcome.digest;
    std::filesystem::remove_all(folder);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFEXITED(status)) return WEXITSTATUS(status);
  std::printf("seed %llu: ended by signal %d\n", static_cast<unsigned long long>(seed), WTERMSIG(status));
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  // Addresses would order what is hashed by them; threads of OpenBLAS spin, which no clock ends here.
  setenv("OPENBLAS_NUM_THREADS", "1", 1);
  if (const int persona = personality(0xffffffff); (persona & ADDR_NO_RANDOMIZE) == 0) {
    if (personality(static_cast<unsigned long>(persona) | ADDR_NO_RANDOMIZE) != -1)
      execv("/proc/self/exe", argv);
  }
  std::uint64_t seed = 1, seeds = 1;
  double hours = 1.0, most = 1e9;
  bool twice = false;
  for (int k = 1; k < argc; ++k) {
    const std::string_view name = argv[k];
    const char* const value = k + 1 < argc ? argv[++k] : nullptr;
    char* end = nullptr;
    const double number = value == nullptr ? 0.0 : std::strtod(value, &end);
    if (value == nullptr || end == value || *end != '\0' || !(number > 0.0 && number < 1e15)) {
      std::fputs(kUsage, stderr);
      return 2;
    }
    if (name == "--seed") {
      seed = static_cast<std::uint64_t>(number);
    } else if (name == "--seeds") {
      seeds = static_cast<std::uint64_t>(number);
    } else if (name == "--hours") {
      hours = number;
    } else if (name == "--seconds") {
      most = number;
    } else if (name == "--twice") {
      twice = true;
    } else {
      std::fputs(kUsage, stderr);
      return 2;
    }
  }
  rlimit files = {};
  getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);
  const auto begin = std::chrono::steady_clock::now();
  void* const shared =
      mmap(nullptr, sizeof(std::uint64_t), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared == MAP_FAILED) return 2;
  auto* const digest = static_cast<std::uint64_t*>(shared);
  int failed = 0;
  for (std::uint64_t k = 0; k < seeds; ++k) {
    if (std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() > most) break;
    if (simulate_alone(seed + k, hours, digest) != 0) {
      ++failed;
      continue;
    }
    const std::uint64_t first = *digest;
    if (!twice || (simulate_alone(seed + k, hours, digest) == 0 && *digest == first)) continue;
    std::printf("seed %llu: its runs differ\n", static_cast<unsigned long long>(seed + k));
    ++failed;
  }
  return failed == 0 ? 0 : 1;
}
