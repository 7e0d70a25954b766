// Frames of server-sent events. While there are viewers, one thread makes each frame once for all viewers
// with the same rights; a viewer that does not keep up misses frames and is notified.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "http/semaphore.h"
#include "mutex.h"
#include "service/service_parts.h"

namespace marble::server::http {

/// "event: NAME\ndata: JSON\n\n".
[[nodiscard]] std::string event(const char* name, const std::string& json);

[[nodiscard]] bool sees_all(const Identity& caller);
/// Returns which clients use the workers: all of them, or only the caller if it may not see the others.
[[nodiscard]] std::string clients_for(const ServiceParts& parts, const Identity& caller);

class EventHub {
  struct Topic;

 public:
  using Frame = std::shared_ptr<const std::string>;
  static constexpr std::chrono::milliseconds kTick{
      125};  ///< of one job's events; those of all jobs come every second tick

  /// Each viewer has a place, and one of parts.feeds.
  EventHub(const ServiceParts& parts, Semaphore& semaphore);
  ~EventHub();
  EventHub(const EventHub&) = delete;
  EventHub& operator=(const EventHub&) = delete;

  /// One stream's position among the frames. The hub must outlive it.
  class Viewer {
   public:
    ~Viewer();
    Viewer(const Viewer&) = delete;
    Viewer& operator=(const Viewer&) = delete;

    struct Next {
      enum { frame, quiet, missed, over } what;
      Frame bytes = nullptr;  ///< set for a frame
    };
    /// Waits for the next frame, at most `patience`; quiet: none came. Missed: some were dropped, and it
    /// continues with the newest.
    [[nodiscard]] Next next(Clock::duration patience);
    /// True if the caller may still see what it watches.
    [[nodiscard]] bool is_for(const Identity& caller) const;

   private:
    friend class EventHub;
    Viewer(EventHub& hub, Semaphore::Permit place, std::string client, std::shared_ptr<Topic> topic,
           std::int64_t at)
        : hub_(hub),
          place_(std::move(place)),
          client_(std::move(client)),
          topic_(std::move(topic)),
          at_(at) {}
    EventHub& hub_;
    const Semaphore::Permit place_;
    const std::string client_;
    const std::shared_ptr<Topic> topic_;
    std::int64_t at_;  // number of the frame to read next
  };

  /// Watches all jobs that the caller may see, and the server itself. Errors: resource_exhausted.
  [[nodiscard]] Expected<std::unique_ptr<Viewer>> watch_all(const Identity& caller);
  /// Watches one job. Errors: not_found, resource_exhausted.
  [[nodiscard]] Expected<std::unique_ptr<Viewer>> watch_job(const Identity& caller, const std::string& id);
  /// Ends all streams, including later ones.
  void stop() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  using Topics = std::vector<std::shared_ptr<Topic>>;
  [[nodiscard]] Expected<std::unique_ptr<Viewer>> join(const Identity& caller, Topic topic)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void leave(const std::string& client, const std::shared_ptr<Topic>& topic) ABSL_LOCKS_EXCLUDED(mutex_);
  void run() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool wait_for_tick() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Topics take_topics() ABSL_LOCKS_EXCLUDED(mutex_);
  void look_at_jobs(Topic& topic, std::vector<Frame>& frames, bool& over);
  void report(Topic& topic, std::vector<Frame> frames, bool over) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Frame server_frame() const;

  const ServiceParts& parts_;
  Semaphore& semaphore_;
  FeedLimit feeds_;  // of the topics: the limit is on viewers
  std::int64_t tick_ = 0;
  Mutex mutex_;
  Condition wake_;
  std::map<std::string, std::shared_ptr<Topic>> topics_ ABSL_GUARDED_BY(mutex_);
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace marble::server::http
