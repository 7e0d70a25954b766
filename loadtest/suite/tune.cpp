#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <map>
#include <string_view>
#include <thread>
#include <type_traits>

#include "families.h"
#include "model/tuning.h"
#include "record.h"
#include "research/tuning.h"
#include "tuning_families.h"

namespace marble::suite {

#ifndef MARBLE_TUNABLE

bool tune(const Sweep&) {
  std::fprintf(stderr,
               "suite: numbers are constants in this build; cmake --preset tune makes one to vary them\n");
  return false;
}

#else

namespace {

enum class Basis { paper, rounding, machine, trial, sweep };

struct Number {
  const char* name;
  Basis basis;
  double value;
  bool whole;
  std::function<void(double)> set;
};

template <class T>
Number number(const char* name, T& variable, Basis basis) {
  return {name, basis, static_cast<double>(variable), std::is_integral_v<T>,
          [&variable](double value) { variable = static_cast<T>(value); }};
}

std::vector<Number> all_numbers() {
  using enum Basis;
  return {
#undef MARBLE_TUNING
#define MARBLE_TUNING(type, name, value, unit, what, basis, why) number(#name, tuning::name, basis),
#include "model/tuning.def"
#include "research/tuning.def"
#undef MARBLE_TUNING
  };
}

// Values below and above, by small and large changes. A number between 0 and 1 near 1, or just above 1, moves
// by its distance from 1; so does a growth factor, which stays above 1.
std::vector<double> others(const Number& n) {
  const bool rises = n.value > 1.0 && std::string_view(n.name).ends_with("_factor");
  std::vector<double> values;
  for (const double factor : {0.1, 1.0 / 3.0, 3.0, 10.0}) {
    double value = n.value * factor;
    if (!n.whole && n.value >= 0.3 && n.value < 1.0) value = 1.0 - (1.0 - n.value) * factor;
    if (!n.whole && ((n.value > 1.0 && n.value < 3.0) || rises)) value = 1.0 + (n.value - 1.0) * factor;
    if (n.whole) value = std::round(value);
    if (value != n.value && value >= 0.0 && (n.whole ? value >= 1.0 : true)) values.push_back(value);
  }
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

using Outcomes = std::vector<Outcome>;

// Runs in a separate process, which an invalid number may end: missing results then count as not solved.
class Measurement {
 public:
  Measurement(const std::vector<Instance>& instances, const std::function<void()>& prepare)
      : outcomes_(instances.size(), Outcome{std::nan(""), 0.0, 0.0}) {
    int ends[2];
    if (pipe(ends) != 0) return;
    child_ = fork();
    if (child_ == 0) {
      std::FILE* const to_parent = fdopen(ends[1], "w");
      prepare();
      for (const Instance& instance : instances) {
        const Outcome outcome = instance.solve();
        std::fwrite(&outcome, sizeof outcome, 1, to_parent);
        std::fflush(to_parent);
      }
      _exit(0);
    }
    close(ends[1]);
    from_child_ = fdopen(ends[0], "r");
  }
  Measurement(const Measurement&) = delete;
  Measurement& operator=(const Measurement&) = delete;
  ~Measurement() {
    if (from_child_ != nullptr) std::fclose(from_child_);
  }

  const Outcomes& wait() {
    if (from_child_ == nullptr) return outcomes_;
    Outcome next;
    for (Outcome& outcome : outcomes_) {
      if (std::fread(&next, sizeof next, 1, from_child_) != 1) break;
      outcome = next;
    }
    waitpid(child_, nullptr, 0);
    return outcomes_;
  }

 private:
  Outcomes outcomes_;
  pid_t child_ = -1;
  std::FILE* from_child_ = nullptr;
};

double worst_tenth(std::vector<double> values) {
  std::sort(values.begin(), values.end(), std::greater<>());
  values.resize(std::max<std::size_t>(1, values.size() / 10));
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// Relative to the base: 1 if only one of the two is solved.
double change(const Outcome& base, const Outcome& other) {
  if (std::isnan(base.objective) && std::isnan(other.objective)) return 0.0;
  if (std::isnan(other.objective)) return 1.0;
  if (std::isnan(base.objective)) return -1.0;
  return std::clamp((other.objective - base.objective) / std::max(1.0, std::abs(base.objective)), -1.0, 1.0);
}

struct Effect {
  int better = 0, worse = 0, changed_work = 0;
  double mean = 0.0;
  std::vector<double> changes, work;  // of each instance
  double factorizations = 0.0, seconds = 0.0;
};

Effect effect(const Outcomes& base, const Outcomes& other) {
  Effect e;
  double base_factorizations = 0.0, base_seconds = 0.0;
  for (std::size_t i = 0; i < base.size(); ++i) {
    const double by = change(base[i], other[i]);
    e.better += by < -1e-6;
    e.worse += by > 1e-6;
    e.mean += by / static_cast<double>(base.size());
    e.changes.push_back(by);
    e.work.push_back(other[i].factorizations / std::max(1.0, base[i].factorizations));
    e.changed_work += base[i].factorizations != other[i].factorizations;
    base_factorizations += base[i].factorizations;
    base_seconds += base[i].seconds;
    e.factorizations += other[i].factorizations;
    e.seconds += other[i].seconds;
  }
  e.factorizations /= base_factorizations;
  e.seconds /= base_seconds;
  return e;
}

bool save(const std::string& name, const Outcomes& outcomes) {
  std::ofstream file(name);
  file.precision(17);
  for (const Outcome& o : outcomes)
    file << o.objective << ' ' << o.factorizations << ' ' << o.seconds << '\n';
  file.close();
  if (!file) std::fprintf(stderr, "suite: cannot write %s\n", name.c_str());
  return !file.fail();
}

// Returns nothing, with a message on stderr, if the number of instances differs.
Outcomes load(const std::string& name, std::size_t count) {
  std::ifstream file(name);
  Outcomes outcomes;
  std::string objective;  // may be nan, which a stream cannot parse
  for (Outcome o; file >> objective >> o.factorizations >> o.seconds;) {
    o.objective = std::strtod(objective.c_str(), nullptr);
    outcomes.push_back(o);
  }
  if (outcomes.size() == count) return outcomes;
  std::fprintf(stderr, "suite: %s has not the outcomes of %zu instances\n", name.c_str(), count);
  return {};
}

std::map<std::string, Effect> by_family(const std::vector<Instance>& instances, const Outcomes& base,
                                        const Outcomes& other) {
  std::map<std::string, std::pair<Outcomes, Outcomes> > outcomes;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    outcomes[instances[i].family].first.push_back(base[i]);
    outcomes[instances[i].family].second.push_back(other[i]);
  }
  std::map<std::string, Effect> effects;
  for (const auto& [family, both] : outcomes) effects[family] = effect(both.first, both.second);
  return effects;
}

// Lists where solutions change: "gates 1 worse, hopper 2 better".
std::string changed_families(const std::map<std::string, Effect>& effects) {
  std::string text;
  for (const auto& [family, e] : effects) {
    for (const auto& [count, word] : {std::pair{e.better, " better"}, std::pair{e.worse, " worse"}}) {
      if (count > 0) text += (text.empty() ? "" : ", ") + family + " " + std::to_string(count) + word;
    }
  }
  return text;
}

void print_families(const std::map<std::string, Effect>& effects) {
  std::printf("\n| family | better | worse | objective, mean | factorizations | time |\n");
  std::printf("| --- | ---: | ---: | ---: | ---: | ---: |\n");
  for (const auto& [family, e] : effects) {
    std::printf("| %s | %d | %d | %+.2f %% | %.2f | %.2f |\n", family.c_str(), e.better, e.worse,
                100.0 * e.mean, e.factorizations, e.seconds);
  }
}

void sweep_each(const std::vector<Instance>& instances, const Outcomes& base,
                const std::vector<Number>& numbers) {
  struct Trial {
    const Number* number;
    double value;
  };
  std::vector<Trial> trials;
  for (const Number& n : numbers) {
    for (const double value : others(n)) trials.push_back({&n, value});
  }
  std::printf(
      "| number | value | tried | objective, mean | worst tenth | work changed | factorizations | time | "
      "where |\n");
  std::printf("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |\n");
  const std::size_t at_once = std::max(1U, std::thread::hardware_concurrency());
  std::vector<std::unique_ptr<Measurement> > running;
  for (std::size_t i = 0; i < trials.size() + at_once; ++i) {
    if (i < trials.size())
      running.push_back(
          std::make_unique<Measurement>(instances, [&trial = trials[i]] { trial.number->set(trial.value); }));
    if (i + 1 < at_once || i + 1 - at_once >= trials.size()) continue;
    const std::size_t done = i + 1 - at_once;
    const Outcomes& other = running[done]->wait();
    const Effect e = effect(base, other);
    const std::string where = changed_families(by_family(instances, base, other));
    running[done].reset();
    const Trial& trial = trials[done];
    std::printf("| `%s` | %g | %g | %+.2f %% | %+.1f %% | %d | %.2f | %.2f | %s |\n", trial.number->name,
                trial.number->value, trial.value, 100.0 * e.mean, 100.0 * worst_tenth(e.changes),
                e.changed_work, e.factorizations, e.seconds, where.c_str());
    std::fflush(stdout);
  }
}

}  // namespace

bool tune(const Sweep& sweep) {
  std::vector<Number> numbers = all_numbers();
  const auto find = [&numbers](const std::string& name) {
    const auto found = std::ranges::find_if(numbers, [&](const Number& n) { return n.name == name; });
    if (found == numbers.end()) std::fprintf(stderr, "suite: tuning.def has no number '%s'\n", name.c_str());
    return found == numbers.end() ? nullptr : &*found;
  };
  std::vector<Number> wanted;
  for (const std::string& name : sweep.names) {
    const Number* n = find(name);
    if (n == nullptr) return false;
    wanted.push_back(*n);
  }
  if (wanted.empty()) {
    std::ranges::copy_if(numbers, std::back_inserter(wanted),
                         [](const Number& n) { return n.basis != Basis::machine; });
  }
  const std::vector<Instance> instances = tuning_instances(sweep.seeds, sweep.judging);
  const Outcomes base =
      sweep.against.empty() ? Measurement(instances, [] {}).wait() : load(sweep.against, instances.size());
  if (base.empty()) return false;
  if (!sweep.save.empty()) return save(sweep.save, base);
  if (sweep.values.empty() && sweep.against.empty()) {
    sweep_each(instances, base, wanted);
    return true;
  }
  std::vector<std::pair<const Number*, double> > values;
  for (const auto& [name, value] : sweep.values) {
    const Number* n = find(name);
    if (n == nullptr) return false;
    values.emplace_back(n, value);
  }
  const Outcomes other = Measurement(instances, [&values] {
                           for (const auto& [n, value] : values) n->set(value);
                         }).wait();
  const Effect e = effect(base, other);
  std::printf("objective: %d better, %d worse of %zu, median %+.3f %%, worst tenth %+.2f %%\n", e.better,
              e.worse, instances.size(), 100.0 * median(e.changes), 100.0 * worst_tenth(e.changes));
  std::printf("factorizations: median %.3f, worst tenth %.2f, all %.3f; time %.2f times\n", median(e.work),
              worst_tenth(e.work), e.factorizations, e.seconds);
  print_families(by_family(instances, base, other));
  return true;
}

#endif

}  // namespace marble::suite
