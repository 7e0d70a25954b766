#include "finding.h"

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

namespace marble::bench {
namespace {

std::vector<Finding>& findings() {
  static std::vector<Finding> all;
  return all;
}

}  // namespace

void report(Finding finding) {
  std::printf("%-72s %8.4f  %s %-7g %s\n    %s\n", finding.name.c_str(), finding.value,
              finding.at_most ? "<=" : ">=", finding.limit, finding.holds() ? "holds" : "MISSED",
              finding.detail.c_str());
  std::fflush(stdout);
  findings().push_back(std::move(finding));
}

bool write_findings(const std::string& path) {
  auto json = nlohmann::ordered_json::array();
  for (const Finding& finding : findings()) {
    json.push_back({{"name", finding.name},
                    {"value", finding.value},
                    {"limit", finding.limit},
                    {"at_most", finding.at_most},
                    {"holds", finding.holds()},
                    {"detail", finding.detail}});
  }
  std::ofstream file(path);
  file << json.dump(1) << '\n';
  file.close();
  return !file.fail();
}

}  // namespace marble::bench
