#include "machine.h"

#include <sys/resource.h>
#include <sys/sysinfo.h>
#include <sys/utsname.h>

#include <fstream>
#include <thread>

namespace marble::load {

Machine this_machine() {
  Machine machine;
  machine.cores = static_cast<int>(std::thread::hardware_concurrency());
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (!line.starts_with("model name")) continue;
    machine.processor = line.substr(std::min(line.find(':') + 2, line.size()));
    break;
  }
  utsname names = {};
  if (uname(&names) == 0) machine.system = std::string(names.sysname) + " " + names.machine;
  struct sysinfo memory = {};
  if (sysinfo(&memory) == 0)
    machine.memory_bytes = static_cast<double>(memory.totalram) * static_cast<double>(memory.mem_unit);
  return machine;
}

double own_cpu_s() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  const auto sum = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return sum(usage.ru_utime) + sum(usage.ru_stime);
}

}  // namespace marble::load
