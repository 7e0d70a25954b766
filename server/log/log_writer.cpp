#include "log/log_writer.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <climits>
#include <string>
#include <utility>

#include "mutex.h"

namespace marble::server {
namespace {

constexpr std::chrono::milliseconds kTogether{10};  // lines that follow this soon are written together
constexpr std::chrono::seconds kLastLines{2};       // for a slow reader at the end

// As many whole lines as a pipe takes at once, so that no lines of other processes come in between (pipe(7),
// PIPE_BUF).
std::string_view piece_of(std::string_view lines) {
  if (lines.size() <= PIPE_BUF) return lines;
  const std::size_t end = lines.rfind('\n', PIPE_BUF - 1);
  return lines.substr(0, (end != std::string_view::npos ? end : lines.find('\n')) + 1);
}

// True once everything is written; false if that fails.
bool write_all(int fd, std::string_view piece) {
  while (!piece.empty()) {
    const ssize_t written = ::write(fd, piece.data(), piece.size());
    if (written >= 0) {
      piece.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno == EAGAIN) {  // set by another process that shares it
      pollfd writable{fd, POLLOUT, 0};
      ::poll(&writable, 1, -1);
    } else if (errno != EINTR) {
      return false;
    }
  }
  return true;
}

}  // namespace

struct LogWriter::Queue {
  Queue(int the_fd, std::int64_t the_most) : fd(the_fd), most(static_cast<std::size_t>(the_most)) {}

  void run() ABSL_LOCKS_EXCLUDED(mutex);
  [[nodiscard]] bool next(std::string& lines) ABSL_LOCKS_EXCLUDED(mutex);
  void write(std::string_view lines) ABSL_LOCKS_EXCLUDED(mutex);

  const int fd;
  const std::size_t most;
  Mutex mutex;
  Condition work;  // idle and something came, or closing
  Condition end;   // the thread has ended
  std::string waiting ABSL_GUARDED_BY(mutex);
  std::size_t in_hand ABSL_GUARDED_BY(mutex) = 0;  // bytes that are being written
  std::int64_t unreported ABSL_GUARDED_BY(mutex) = 0, dropped ABSL_GUARDED_BY(mutex) = 0;
  bool idle ABSL_GUARDED_BY(mutex) = false;  // the thread waits for a line
  bool failed ABSL_GUARDED_BY(mutex) = false;
  bool closing ABSL_GUARDED_BY(mutex) = false, over ABSL_GUARDED_BY(mutex) = false;
};

void LogWriter::Queue::run() {
  for (std::string lines; next(lines);) write(lines);
  const MutexLock lock(mutex);
  over = true;
  end.notify_all();
}

// Waking the thread for each line would cost its caller more than the line: a short sleep collects the lines
// that follow.
bool LogWriter::Queue::next(std::string& lines) {
  const MutexLock lock(mutex);
  const auto nap_end = std::chrono::steady_clock::now() + kTogether;
  while (!closing && work.wait_until(mutex, nap_end) == std::cv_status::no_timeout) {
  }
  idle = true;
  while (waiting.empty() && !closing) work.wait(mutex);
  idle = false;
  lines.clear();
  lines.swap(waiting);
  in_hand = lines.size();
  return in_hand > 0;
}

void LogWriter::Queue::write(std::string_view lines) {
  bool written = true;
  while (written && !lines.empty()) {
    const std::string_view piece = piece_of(lines);
    written = write_all(fd, piece);
    if (written) lines.remove_prefix(piece.size());
  }
  const MutexLock lock(mutex);
  const auto lost = std::count(lines.begin(), lines.end(), '\n');
  unreported += lost;
  dropped += lost;
  failed = !written;
  in_hand = 0;
}

LogWriter::LogWriter(int fd, std::int64_t most_bytes)
    : queue_(std::make_shared<Queue>(fd, most_bytes)), thread_([queue = queue_] { queue->run(); }) {}

LogWriter::~LogWriter() {
  bool over = false;
  {
    const MutexLock lock(queue_->mutex);
    queue_->closing = true;
    queue_->work.notify_one();
    const auto end = std::chrono::steady_clock::now() + kLastLines;
    while (!queue_->over && queue_->end.wait_until(queue_->mutex, end) == std::cv_status::no_timeout) {
    }
    over = queue_->over;
  }
  if (over) {
    thread_.join();
  } else {
    thread_.detach();  // the thread ends with the process
  }
}

LogWriter::Backlog LogWriter::backlog() const {
  const MutexLock lock(queue_->mutex);
  return {queue_->failed || queue_->in_hand > 0 || !queue_->waiting.empty(), queue_->unreported};
}

std::int64_t LogWriter::dropped() const {
  const MutexLock lock(queue_->mutex);
  return queue_->dropped;
}

void LogWriter::put(std::string_view line, std::int64_t reported) {
  const MutexLock lock(queue_->mutex);
  if (queue_->in_hand + queue_->waiting.size() + line.size() > queue_->most) {
    ++queue_->unreported;
    ++queue_->dropped;
    return;
  }
  queue_->unreported -= reported;
  queue_->waiting.append(line);
  if (queue_->idle) queue_->work.notify_one();
}

}  // namespace marble::server
