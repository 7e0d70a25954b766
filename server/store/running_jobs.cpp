#include "store/running_jobs.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

namespace marble::server {
namespace {

constexpr std::size_t kLine = 80;  // bytes, including the newline
constexpr std::size_t kLongestId = 64;

// Changes whenever the machine starts.
std::string boot() {
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  std::string id;
  file >> id;
  return "boot-" + id;
}

Error fault_of(const std::string& file) {
  return failure(ErrorCode::unavailable, "state_dir", file, std::strerror(errno));
}

}  // namespace

Expected<RunningJobs> RunningJobs::open(const std::string& file) {
  Descriptor descriptor(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, S_IRUSR | S_IWUSR));
  if (!descriptor) return unexpected(fault_of(file));
  return RunningJobs(file, std::move(descriptor));
}

std::vector<JobStart> RunningJobs::left() const {
  std::ifstream file(file_);
  std::string line;
  if (!std::getline(file, line) || !line.starts_with(boot())) return {};
  std::vector<JobStart> starts;
  while (std::getline(file, line)) {
    JobStart start;
    std::istringstream words(line);
    if (words >> start.id >> start.number && start.number > 0) starts.push_back(std::move(start));
  }
  return starts;
}

Expected<void> RunningJobs::clear() {
  if (ftruncate(descriptor_.get(), 0) != 0) return unexpected(fault_of(file_));
  write(0, boot());
  return {};
}

void RunningJobs::began(const JobStart& start) {
  if (start.id.empty() || start.id.size() > kLongestId || start.id.find_first_of(" \n") != std::string::npos)
    return;
  const MutexLock lock(state_->mutex);
  auto& lines = state_->lines;
  const auto free = std::ranges::find(lines, std::string());
  const auto at = static_cast<std::size_t>(free - lines.begin());
  if (free == lines.end()) lines.emplace_back();
  lines[at] = start.id;
  write(at + 1, start.id + " " + std::to_string(start.number));
}

void RunningJobs::ended(const std::string& id) {
  const MutexLock lock(state_->mutex);
  const auto found = std::ranges::find(state_->lines, id);
  if (id.empty() || found == state_->lines.end()) return;
  found->clear();
  write(static_cast<std::size_t>(found - state_->lines.begin()) + 1, "");
}

// A line that cannot be written is not counted: the job runs nevertheless.
void RunningJobs::write(std::size_t line, const std::string& text) const {
  std::string padded = text.substr(0, kLine - 1);
  padded.resize(kLine - 1, ' ');
  padded += '\n';
  [[maybe_unused]] const auto written =
      pwrite(descriptor_.get(), padded.data(), padded.size(), static_cast<off_t>(line * kLine));
}

}  // namespace marble::server
