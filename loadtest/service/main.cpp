// Measures the service over real connections to a server process of its own, and prints tables.
// Usage: service_bench [mpc | flood | idle | cost ...]    all of them by default
#include <algorithm>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "bench.h"

int main(int argc, char** argv) {
  using namespace marble;
  const std::vector<std::string> wanted(argv + 1, argv + argc);
  const std::pair<const char*, void (*)()> parts[] = {
      {"mpc", bench::mpc}, {"flood", bench::flood}, {"idle", bench::idle}, {"cost", bench::cost}};
  for (const std::string& name : wanted) {
    if (std::ranges::none_of(parts, [&](const auto& part) { return name == part.first; })) {
      std::fprintf(stderr, "service_bench: there is no part '%s'\n", name.c_str());
      return 2;
    }
  }
  for (const auto& [name, run] : parts) {
    if (!wanted.empty() && std::ranges::find(wanted, name) == wanted.end()) continue;
    std::printf("== %s\n", name);
    run();
    std::fflush(stdout);
  }
  return 0;
}
