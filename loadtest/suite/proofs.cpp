// Checks proofs: they are written to files and checked in exact rational numbers by a program that shares
// nothing with the solver.
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "families.h"
#include "hard_families.h"
#include "marble/examples.h"
#include "marble/json_problem.h"
#include "marble/json_proof.h"
#include "marble/macmpec.h"
#include "marble/solver.h"
#include "support/ill_conditioned.h"
#include "support/integer_problem.h"

namespace marble::suite {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kAtOnce = 200;  // files that one run of the checker reads

// The results of a family's proofs.
struct ProofTally {
  int problems = 0, claimed = 0, written = 0;
  std::map<std::string, int> unproved;  // by status
  std::map<std::string, int> words;     // of the checker: holds, assumes |z| <= radius, or a reason
  std::size_t leaves = 0;
  std::uintmax_t bytes = 0;
  double solve_s = 0.0, check_s = 0.0;
};

// Returns the verdict of a line of the checker: {"verdict": "holds", ...}, or with an "error". Drops its
// numbers, which vary.
std::string word_of(const std::string& line) {
  if (line.starts_with("{\"verdict\": \"holds\"")) return "hold";
  if (line.starts_with("{\"verdict\": \"holds for")) return "hold for |z| <= radius";
  const std::string key = "\"error\": \"";
  const std::size_t begin = line.find(key);
  std::string error = begin == std::string::npos ? line : line.substr(begin + key.size());
  error = error.substr(0, error.find('"'));
  std::erase_if(error, [](char c) { return c >= '0' && c <= '9'; });
  return error;
}

// Proofs that wait for the checker, in a separate folder.
class Folder {
 public:
  Folder(std::string checker, const fs::path& kept)
      : checker_(std::move(checker)),
        kept_(!kept.empty()),
        path_(kept_ ? kept : fs::temp_directory_path() / ("marble-proofs-" + std::to_string(getpid()))) {
    fs::create_directories(path_);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    if (!kept_) fs::remove_all(path_);
  }

  void add(const OwnedProblem& problem, const Options& options, const Solution& solution, const Proof& proof,
           ProofTally& tally) {
    const std::string stem = path_ / std::to_string(number_++);
    std::ofstream(stem + ".json") << write_json(problem, std::nullopt) << '\n';
    {
      std::ofstream file(stem + ".jsonl");
      write_proof(proof, problem.view(), options, solution, [&file](std::string_view text) { file << text; });
    }
    tally.bytes += fs::file_size(stem + ".jsonl");
    files_ += " " + stem + ".json " + stem + ".jsonl";
    if (++waiting_ >= kAtOnce) check(tally);
  }

  void check(ProofTally& tally) {
    if (waiting_ == 0) return;
    const auto begun = std::chrono::steady_clock::now();
    const std::string command = checker_ + files_;
    {
      const std::unique_ptr<std::FILE, int (*)(std::FILE*)> out(popen(command.c_str(), "r"), pclose);
      char line[1024];
      for (std::size_t i = 0; i < waiting_; ++i)
        ++tally.words[out && std::fgets(line, sizeof line, out.get()) != nullptr ? word_of(line)
                                                                                 : "no checker"];
    }
    tally.check_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    for (const auto& entry : fs::directory_iterator(path_)) {
      if (!kept_) fs::remove(entry.path());
    }
    files_.clear();
    waiting_ = 0;
  }

 private:
  std::string checker_, files_;
  bool kept_;
  fs::path path_;
  std::size_t waiting_ = 0;
  int number_ = 0;
};

void prove(const OwnedProblem& problem, const Options& options, Folder& folder, ProofTally& tally) {
  Proof proof;
  SolveControls controls;
  controls.proof = &proof;
  const auto begun = std::chrono::steady_clock::now();
  const auto solution = solve_in_process(problem.view(), options, controls);
  tally.solve_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  ++tally.problems;
  if (!solution || solution->status == Status::unbounded) return;
  if (!solution->proved) ++tally.unproved[to_string(solution->status)];
  tally.claimed += solution->proved;
  if (proof.claim == Proof::Claim::none) {
    if (solution->proved) ++tally.words["not written: " + proof.reason];
    return;
  }
  if (!solution->proved) return;  // a true bound, but no proof of the solution
  ++tally.written;
  tally.leaves += proof.leaves.size();
  folder.add(problem, options, *solution, proof, tally);
}

void print(const std::string& family, const ProofTally& t) {
  std::string words;
  const auto add = [&words](const std::map<std::string, int>& counts, const char* what) {
    for (const auto& [word, count] : counts)
      words += (words.empty() ? "" : ", ") + std::to_string(count) + " " + word + what;
  };
  add(t.words, "");
  add(t.unproved, " without proof");
  std::printf("%-24s %8d %7d %7d %8zu %10.1f %9.2f %9.2f  %s\n", family.c_str(), t.problems, t.claimed,
              t.written, t.leaves, static_cast<double>(t.bytes) / 1024.0, t.solve_s, t.check_s,
              words.c_str());
  std::fflush(stdout);
}

// Gates displaced by up to 0.3 m and 0.2 rad: bounds on tilt and thrust leave no way through some.
OwnedProblem scattered_gates(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto shift = [&random](double size) {
    return size * (static_cast<double>(random() >> 11) * 0x1p-52 - 1.0);
  };
  examples::GatesParameters parameters;
  for (auto& gate : parameters.gates) {
    for (double& coordinate : gate.center) coordinate += shift(0.3);
    gate.yaw += shift(0.2);
  }
  return examples::gates(parameters);
}

}  // namespace

void proofs(const Settings& settings) {
  std::printf("%-24s %8s %7s %7s %8s %10s %9s %9s  %s\n", "proofs", "problems", "proved", "written", "leaves",
              "KiB", "solve s", "check s", "checker");
  Folder folder(settings.checker, settings.keep);
  const auto wanted = [&](const char* part) { return settings.only.empty() || settings.only == part; };
  const auto family = [&](const std::string& name, const Options& options, auto&& each) {
    ProofTally tally;
    each([&](const OwnedProblem& problem) { prove(problem, options, folder, tally); });
    folder.check(tally);
    print(name, tally);
  };
  Options global;
  global.global_search = true;
  global.time_limit_s = settings.time_limit_s;
  if (wanted("macmpec")) {
    for (const examples::MacmpecProblem& each : examples::macmpec())
      family(std::string(each.name), global, [&](auto&& take) { take(each.problem()); });
  }
  if (wanted("robots")) {
    examples::HopperParameters hopper;
    hopper.steps = 10;
    family("hopper, 10 steps", global, [&](auto&& take) { take(examples::hopper(hopper)); });
    family("rocket", global, [&](auto&& take) { take(examples::rocket()); });
    family("gates", global, [&](auto&& take) { take(examples::gates()); });
  }
  const auto seed_of = [&](int i) {  // odd seeds are for tuning, even ones for judging
    return 2 * static_cast<std::uint64_t>(i) + (settings.judging ? 2 : 1);
  };
  if (wanted("gates")) {
    family("scattered gates", {}, [&](auto&& take) {
      for (int i = 0; i < settings.seeds; ++i) take(scattered_gates(seed_of(i)));
    });
  }
  if (wanted("qpecs")) {
    family("qpec, 10 + 20 variables", global, [&](auto&& take) {
      for (int i = 0; i < settings.seeds; ++i) take(examples::qpec({10, 20, 4, 2}, seed_of(i)));
    });
  }
  if (wanted("integers")) {
    for (const testing::IntegerFamily kind : testing::kIntegerFamilies) {
      for (const bool in_tree : {false, true}) {
        Options options;
        options.global_search = in_tree;
        family(std::string(testing::name(kind)) + (in_tree ? ", global" : ""), options, [&](auto&& take) {
          for (int i = 0; i < settings.seeds; ++i) take(testing::integer_problem(kind, seed_of(i)));
        });
      }
    }
  }
  if (wanted("hard")) {
    std::map<std::string, std::vector<HardProblem>> families;
    for (HardProblem& problem : hard_problems(settings.seeds, settings.judging))
      families[problem.family].push_back(std::move(problem));
    for (const auto& hard : families) {
      family(hard.first, {}, [&hard](auto&& take) {
        for (const HardProblem& problem : hard.second) take(problem.problem);
      });
    }
  }
  if (wanted("lcps")) {
    for (const bool far : {false, true}) {
      for (const double smallest : {1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12}) {
        char name[32];
        std::snprintf(name, sizeof name, "LCPs, %s, %.0e", far ? "far" : "near", smallest);
        family(name, {}, [&](auto&& take) {
          for (int i = 0; i < settings.seeds; ++i)
            take(testing::ill_conditioned_lcp(smallest, seed_of(i), far));
        });
      }
    }
  }
}

}  // namespace marble::suite
