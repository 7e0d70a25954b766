#include "process/fault_point.h"

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <string>

namespace marble::server {
namespace {

struct Fault {
  std::string name;
  int pass = 0;
};

Fault chosen() {
  const char* const text = std::getenv("MARBLE_FAULT_POINT");
  const std::string_view fault = text == nullptr ? "" : text;
  const std::size_t colon = fault.find(':');
  if (colon == std::string_view::npos) return {};
  return {std::string(fault.substr(0, colon)), std::atoi(fault.substr(colon + 1).data())};
}

}  // namespace

void fault_point(std::string_view name) {
  static const Fault fault = chosen();
  static std::atomic<int> passes = 0;
  if (!fault.name.empty() && name == fault.name && ++passes == fault.pass) (void)raise(SIGKILL);
}

}  // namespace marble::server
