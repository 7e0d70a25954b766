// Measures the service over real connections to a separate server process, and prints tables.
#include <algorithm>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "bench.h"
#include "echo_server.h"

namespace {

constexpr const char* kUsage =
    "Measures the service over real connections to a server process of its own, and prints tables.\n"
    "Usage: service_bench [--findings FILE] [PART ...]\n"
    "  PART             mpc, flood, beside, idle, cost, remote, throughput, crowd, streaming or durable; all "
    "of "
    "them by default\n"
    "  --findings FILE  gets the ratios with their limits as JSON\n";

}  // namespace

int main(int argc, char** argv) {
  using namespace marble;
  std::vector<std::string> wanted(argv + 1, argv + argc);
  if (std::ranges::any_of(wanted, [](const std::string& word) { return word == "--help" || word == "-h"; })) {
    std::fputs(kUsage, stdout);
    return 0;
  }
  if (wanted.size() == 2 && wanted[0] == "--echo-server") return bench::EchoServer::serve(wanted[1]);
  std::string findings;
  if (wanted.size() >= 2 && wanted[0] == "--findings") {
    findings = wanted[1];
    wanted.erase(wanted.begin(), wanted.begin() + 2);
  }
  const std::pair<const char*, void (*)()> parts[] = {{"mpc", bench::mpc},
                                                      {"flood", bench::flood},
                                                      {"beside", bench::beside},
                                                      {"idle", bench::idle},
                                                      {"cost", bench::cost},
                                                      {"remote", bench::remote},
                                                      {"throughput", bench::throughput},
                                                      {"crowd", bench::crowd},
                                                      {"streaming", bench::streaming},
                                                      {"durable", bench::durable}};
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
  if (findings.empty() || bench::write_findings(findings)) return 0;
  std::fprintf(stderr, "service_bench: cannot write %s\n", findings.c_str());
  return 1;
}
