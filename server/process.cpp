#include "process.h"

#include <sys/resource.h>
#include <unistd.h>

#include <fstream>

namespace marble::server {

ProcessUsage process_usage() {
  ProcessUsage usage;
  std::int64_t total_pages = 0, resident_pages = 0;
  std::ifstream statm("/proc/self/statm");  // proc_pid_statm(5): size, resident, ... in pages
  if (statm >> total_pages >> resident_pages) usage.resident_bytes = resident_pages * sysconf(_SC_PAGESIZE);
  rusage times = {};
  getrusage(RUSAGE_SELF, &times);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  usage.cpu_s = seconds(times.ru_utime) + seconds(times.ru_stime);
  return usage;
}

}  // namespace marble::server
