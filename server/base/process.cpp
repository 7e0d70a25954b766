#include "base/process.h"

#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <thread>

namespace marble::server {
namespace {

// Returns the machine's boot time, in Unix time: proc_stat(5), btime.
double boot_time_s() {
  std::ifstream stat("/proc/stat");
  double seconds = 0.0;
  for (std::string word; stat >> word;) {
    if (word == "btime" && stat >> seconds) break;
  }
  return seconds;
}

int entries_of(const char* directory) {
  std::error_code ignored;
  int count = 0;
  for (std::filesystem::directory_iterator entry(directory, ignored), end; entry != end;
       entry.increment(ignored))
    ++count;
  return count;
}

}  // namespace

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

int usable_cores() {
  cpu_set_t cores;
  const bool known = sched_getaffinity(0, sizeof cores, &cores) == 0;  // fails beyond 1024 cores
  return std::max(1, known ? CPU_COUNT(&cores) : static_cast<int>(std::thread::hardware_concurrency()));
}

std::int64_t raise_descriptor_limit() {
  rlimit limit = {};
  getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
  getrlimit(RLIMIT_NOFILE, &limit);
  return static_cast<std::int64_t>(
      std::min<rlim_t>(limit.rlim_cur, std::numeric_limits<std::int32_t>::max()));
}

ProcessFacts process_facts() {
  ProcessFacts facts;
  facts.open_fds = entries_of("/proc/self/fd") - 1;  // without the descriptor used for reading
  std::ifstream stat("/proc/self/stat");             // proc_pid_stat(5): pid (name) state ...
  stat.ignore(std::numeric_limits<std::streamsize>::max(), ')');
  constexpr int kThreads = 20, kStartTime = 22;
  std::string field;
  for (int number = 3; stat >> field && number <= kStartTime; ++number) {
    if (number == kThreads) facts.threads = std::stoi(field);
    if (number == kStartTime)
      facts.start_time_s = boot_time_s() + std::stod(field) / static_cast<double>(sysconf(_SC_CLK_TCK));
  }
  return facts;
}

bool others_wait() {
  std::error_code ignored;
  const std::filesystem::directory_iterator threads("/proc/self/task", ignored);
  const std::string own = std::to_string(gettid());
  return std::none_of(begin(threads), end(threads), [&](const std::filesystem::directory_entry& thread) {
    if (thread.path().filename() == own) return false;
    std::ifstream stat(thread.path() / "stat");  // proc_pid_stat(5): pid (name) state ...
    stat.ignore(std::numeric_limits<std::streamsize>::max(), ')');
    char state = 'S';
    stat >> state;
    return state == 'R' || state == 'D';
  });
}

}  // namespace marble::server
