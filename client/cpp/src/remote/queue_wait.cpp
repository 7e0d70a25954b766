#include "remote/queue_wait.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "connection/patience.h"
#include "message/status.h"

namespace marble::client {
namespace {

using Seconds = QueueWait::Seconds;

constexpr std::array<std::string_view, 4> kQueueLimits = {"queue_jobs", "queue_bytes", "client_queued",
                                                          "client_bytes"};
constexpr Seconds kDefaultQueueWait(10.0), kShortestDelay(0.01), kLongestDelay(60.0);
constexpr double kMostSpread = 1.2;  // of a pause

}  // namespace

Expected<QueueWait> QueueWait::create(std::optional<Seconds> wait, std::optional<Seconds> deadline,
                                      std::stop_token stop, const Waiting& waiting) {
  if (wait && !(*wait >= Seconds(0.0))) return unexpected(invalid("queue_wait", "must be >= 0 seconds"));
  const Seconds otherwise = deadline ? Seconds(std::numeric_limits<double>::infinity()) : kDefaultQueueWait;
  return QueueWait(wait.value_or(otherwise), deadline, std::move(stop), waiting);
}

std::optional<Seconds> QueueWait::left() const {
  if (!deadline_) return std::nullopt;
  return *deadline_ - (Clock::now() - begun_);
}

bool QueueWait::pause(const grpc::Status& status) {
  const auto delay = retry_after(status);
  if (!delay) return false;
  const Error reason = to_error(status);
  if (std::find(kQueueLimits.begin(), kQueueLimits.end(), reason.field) == kQueueLimits.end()) return false;
  const Clock::time_point now = Clock::now();
  const bool is_first = !refused_;
  if (is_first) refused_ = now;
  const Seconds more = wait_ - (now - *refused_);
  if (!(more > Seconds(0.0))) return false;
  const Seconds pause =
      std::min(std::clamp(*delay, kShortestDelay, kLongestDelay) * random_factor(1.0, kMostSpread), more);
  if (const auto time = left(); time && pause >= *time) return false;
  if (is_first && waiting_) waiting_(reason);
  return !is_stopped_within(pause, stop_);
}

Error QueueWait::error(const grpc::Status& status) const {
  if (stop_.stop_requested()) return failure(ErrorCode::cancelled, "cancelled by the caller");
  return to_error(status, stop_);
}

}  // namespace marble::client
