#include "base/fault_point.h"

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace marble::server {
namespace {

struct Fault {
  std::string name;
  int pass = 0;
  std::string subject = {};
  bool throws = false;
};

Fault chosen() {
  const char* const text = std::getenv("MARBLE_FAULT_POINT");
  const std::string_view fault = text == nullptr ? "" : text;
  const std::size_t colon = fault.find(':');
  if (const std::size_t sign = fault.find_first_of("=!"); sign != std::string_view::npos)
    return {.name = std::string(fault.substr(0, sign)),
            .subject = std::string(fault.substr(sign + 1)),
            .throws = fault[sign] == '!'};
  if (colon == std::string_view::npos) return {};
  return {std::string(fault.substr(0, colon)), std::atoi(fault.substr(colon + 1).data())};
}

}  // namespace

void fault_point(std::string_view name, std::string_view subject) {
  static const Fault fault = chosen();
  static std::atomic<int> passes = 0;
  if (fault.name.empty() || name != fault.name) return;
  if (fault.subject.empty() ? ++passes != fault.pass : subject != fault.subject) return;
  if (fault.throws) throw std::runtime_error("fault point " + fault.name);
  (void)raise(SIGKILL);
}

}  // namespace marble::server
