// Runs families of problems and prints the solver's results.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <string>

#include "families.h"

namespace {

constexpr const char* kUsage = R"(Runs families of problems and prints what the solver reached on them.
Usage: suite [FAMILY ...] [--seeds N] [--judge] [--starts K] [--peers COMMAND]
       suite tune [--seeds N] [--judge] [--save FILE | --against FILE] [NAME ... | NAME=VALUE ...]
Families: macmpec perturbed robotics variants qpecs warm mpc growth horizons units throughput global hard statuses starts
sessions proofs conflicts qp coupled scenarios batches; all of them by default.
  --seeds N            of the random families, default 20
  --judge              hard, statuses, starts, sessions, proofs, conflicts, scenarios, horizons and batches: on the half
                       of the seeds that nothing is chosen on
  --starts K           of the references where none is known, default 8
  --time-limit S       of global and proofs, default 60
  --only NAME          of global and qp, that problem; of coupled small, large, hoppers or segments; of sessions random,
                       hoppers or cart_poles; of scenarios optima, chains, many or hopper; of proofs macmpec, robots,
                       gates, qpecs, integers, hard or lcps; of batches cart-pole, hopper, random or tiny
  --keep FOLDER        of proofs: leave problems and proofs there
  --steps N            of coupled and horizons, the hopper of that horizon: 120, 240, 480, 960 or 1920
  --option NAME=VALUE  of macmpec and robotics, a solver option; may be repeated
  --peers COMMAND      measure qp or global in turns with other solvers: COMMAND runs qp_peers.py or global_peers.py of
                       loadtest/suite/*_peers.py
tune, in a build of the preset tune: what numbers of core/src/model/tuning.def do on generated families, one by one, or
what these values do together. On odd seeds, --seeds N (default 10) of each family; with --judge on even ones, the half
that nothing is chosen on. --save keeps the results of a table, --against compares with those of another one.
)";

int tune(int argc, char** argv) {
  marble::suite::Sweep sweep;
  for (int i = 0; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::size_t equals = argument.find('=');
    if (argument == "--judge") {
      sweep.judging = true;
    } else if (argument == "--seeds" && i + 1 < argc) {
      sweep.seeds = std::max(1, std::atoi(argv[++i]));
    } else if ((argument == "--save" || argument == "--against") && i + 1 < argc) {
      (argument == "--save" ? sweep.save : sweep.against) = argv[++i];
    } else if (argument.starts_with("-")) {
      std::fputs(kUsage, argument == "--help" || argument == "-h" ? stdout : stderr);
      return argument == "--help" || argument == "-h" ? 0 : 2;
    } else if (equals == std::string::npos) {
      sweep.names.push_back(argument);
    } else {
      sweep.values.emplace_back(argument.substr(0, equals), std::atof(argument.c_str() + equals + 1));
    }
  }
  return marble::suite::tune(sweep) ? 0 : 2;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "tune") == 0) return tune(argc - 2, argv + 2);
  using namespace marble;
  suite::Settings settings;
  std::vector<std::string> wanted;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const auto value = [&]() -> const char* {
      if (i + 1 < argc) return argv[++i];
      std::fprintf(stderr, "suite: %s needs a value\n", argument.c_str());
      std::exit(2);
    };
    if (argument == "--help" || argument == "-h") {
      std::fputs(kUsage, stdout);
      return 0;
    }
    if (argument == "--seeds") {
      settings.seeds = std::max(1, std::atoi(value()));
    } else if (argument == "--judge") {
      settings.judging = true;
    } else if (argument == "--starts") {
      settings.starts = std::max(1, std::atoi(value()));
    } else if (argument == "--time-limit") {
      settings.time_limit_s = std::max(0.0, std::atof(value()));
    } else if (argument == "--option") {
      const std::string option = value();
      const std::size_t equals = option.find('=');
      const std::string text = equals == std::string::npos ? "" : option.substr(equals + 1);
      if (auto set = set_option_text(settings.options, option.substr(0, equals), text); !set) {
        std::fprintf(stderr, "suite: %s\n", set.error().message().c_str());
        return 2;
      }
    } else if (argument == "--keep") {
      settings.keep = value();
    } else if (argument == "--only") {
      settings.only = value();
    } else if (argument == "--steps") {
      settings.steps = std::atoi(value());
    } else if (argument == "--peers") {
      settings.peers = value();
    } else {
      wanted.push_back(argument);
    }
  }

  const std::pair<const char*, std::function<void(const suite::Settings&)>> families[] = {
      {"macmpec", suite::macmpec},   {"perturbed", suite::perturbed},   {"robotics", suite::robotics},
      {"variants", suite::variants}, {"qpecs", suite::qpecs},           {"warm", suite::warm},
      {"mpc", suite::mpc},           {"growth", suite::growth},         {"horizons", suite::horizons},
      {"units", suite::units},       {"throughput", suite::throughput}, {"global", suite::global},
      {"hard", suite::hard},         {"statuses", suite::statuses},     {"starts", suite::starts},
      {"proofs", suite::proofs},     {"conflicts", suite::conflicts},   {"qp", suite::qp},
      {"coupled", suite::coupled},   {"scenarios", suite::scenarios},   {"batches", suite::batches},
      {"sessions", suite::sessions}};
  for (const std::string& name : wanted) {
    if (std::ranges::none_of(families, [&](const auto& family) { return name == family.first; })) {
      std::fprintf(stderr, "suite: there is no family '%s'\n", name.c_str());
      return 2;
    }
  }
  for (const auto& [name, run] : families) {
    if (!wanted.empty() && std::ranges::find(wanted, name) == wanted.end()) continue;
    std::printf("== %s\n", name);
    run(settings);
  }
  return 0;
}
