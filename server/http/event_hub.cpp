#include "http/event_hub.h"

#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "http/fleet_routes.h"
#include "http/reply.h"
#include "jobs/recent_json.h"
#include "service/job_access.h"
#include "service/server_info.h"

namespace marble::server::http {
namespace {

constexpr std::size_t kKeptFrames = 32;  // how far a viewer may fall behind
constexpr int kTicksOfAll = 2;           // between updates of all jobs
constexpr int kTicksOfServer = 4;        // between updates of the server
constexpr int kTicksOfClients = 16;      // and of the clients' use of its workers, and of other servers

/// The properties that decide which jobs a caller sees, and nothing else: callers with equal ones share a
/// topic.
Identity visibility(const Identity& caller) {
  return sees_all(caller) ? Identity{"", {Role::observe}} : Identity{caller.client, {}};
}

/// The key of the role is one that no client name can produce.
std::string key_of_all(const Identity& caller) { return sees_all(caller) ? "*" : "client " + caller.client; }

EventHub::Frame frame_of(const char* name, const std::string& json) {
  return std::make_shared<const std::string>(event(name, json));
}

}  // namespace

bool sees_all(const Identity& caller) {
  return caller.roles.has(Role::observe) || caller.roles.has(Role::admin);
}

std::string clients_for(const ServiceParts& parts, const Identity& caller) {
  const ClientShares shares = parts.scheduler.client_shares();
  return sees_all(caller) ? clients_json(shares) : clients_json(shares, caller.client);
}

std::string event(const char* name, const std::string& json) {
  return std::string("event: ") + name + "\ndata: " + json + "\n\n";
}

/// The frames for all viewers with the same rights. Guarded by the hub's mutex, except members used only by
/// its thread.
struct EventHub::Topic {
  std::string key;
  std::string job_id, owner;  // empty: all jobs
  Identity viewer;            // whose rights the feed uses

  int viewers = 0;
  bool has_newcomer = false;
  std::deque<Frame> frames = {};
  std::int64_t end = 0;  // number of the next frame
  bool over = false;
  std::shared_ptr<Condition> reported = std::make_shared<Condition>();

  std::unique_ptr<JobFeed> feed = nullptr;  // used only by the hub's thread
  std::int64_t skipped = 0;                 // by this feed; hub's thread only
  bool starts = false;                      // report from the start; hub's thread only
};

EventHub::EventHub(const ServiceParts& parts, Semaphore& semaphore)
    : parts_(parts),
      semaphore_(semaphore),
      feeds_(std::numeric_limits<int>::max()),
      thread_([this] { run(); }) {}

EventHub::~EventHub() {
  stop();
  thread_.join();
}

void EventHub::stop() {
  const MutexLock lock(mutex_);
  stopping_ = true;
  wake_.notify_all();
  for (const auto& [key, topic] : topics_) topic->reported->notify_all();
}

Expected<std::unique_ptr<EventHub::Viewer>> EventHub::watch_all(const Identity& caller) {
  return join(caller, {.key = key_of_all(caller), .job_id = "", .owner = "", .viewer = visibility(caller)});
}

Expected<std::unique_ptr<EventHub::Viewer>> EventHub::watch_job(const Identity& caller,
                                                                const std::string& id) {
  MARBLE_ASSIGN_OR_RETURN(const auto record, find_job(parts_.board, caller, id));
  const std::string& owner = record->description().client;
  return join(caller, {.key = "job " + id, .job_id = id, .owner = owner, .viewer = {owner, {}}});
}

Expected<std::unique_ptr<EventHub::Viewer>> EventHub::join(const Identity& caller, Topic topic) {
  const Quota quota = parts_.access.quota_of(caller.client);
  MARBLE_RETURN_IF_ERROR(parts_.feeds.enter(caller.client, quota.watchers));
  auto place = semaphore_.stay();
  if (!place) {
    parts_.feeds.leave(caller.client);
    return unexpected(place.error());
  }
  const MutexLock lock(mutex_);
  std::shared_ptr<Topic>& shared = topics_[topic.key];
  if (shared == nullptr || shared->over) shared = std::make_shared<Topic>(std::move(topic));
  ++shared->viewers;
  shared->has_newcomer = true;
  wake_.notify_all();
  return std::unique_ptr<Viewer>(new Viewer(*this, *std::move(place), caller.client, shared, shared->end));
}

void EventHub::leave(const std::string& client, const std::shared_ptr<Topic>& topic) {
  parts_.feeds.leave(client);
  const MutexLock lock(mutex_);
  if (--topic->viewers > 0) return;
  const auto found = topics_.find(topic->key);
  if (found != topics_.end() && found->second == topic) topics_.erase(found);
}

EventHub::Viewer::~Viewer() { hub_.leave(client_, topic_); }

bool EventHub::Viewer::is_for(const Identity& caller) const {
  return topic_->job_id.empty() ? key_of_all(caller) == topic_->key : may_see(caller, topic_->owner);
}

EventHub::Viewer::Next EventHub::Viewer::next(Clock::duration patience) {
  const auto until = Clock::now() + patience;
  const MutexLock lock(hub_.mutex_);
  while (at_ == topic_->end && !topic_->over && !hub_.stopping_) {
    if (topic_->reported->wait_until(hub_.mutex_, until) == std::cv_status::timeout) return {Next::quiet};
  }
  if (hub_.stopping_ || at_ == topic_->end) return {Next::over};
  const auto behind = static_cast<std::size_t>(topic_->end - at_);
  if (behind > topic_->frames.size()) {
    at_ = topic_->end;
    return {Next::missed};
  }
  ++at_;
  return {Next::frame, topic_->frames[topic_->frames.size() - behind]};
}

void EventHub::run() {
  while (wait_for_tick()) {
    ++tick_;
    Frame server;  // one for all topics
    for (const std::shared_ptr<Topic>& topic : take_topics()) {
      std::vector<Frame> frames;
      bool over = false;
      const bool all = topic->job_id.empty();
      if (all && (topic->starts || tick_ % kTicksOfServer == 0)) {
        if (server == nullptr) server = server_frame();
        frames.push_back(server);
      }
      if (all && (topic->starts || tick_ % kTicksOfClients == 0))
        frames.push_back(frame_of("clients", clients_for(parts_, topic->viewer)));
      if (all && sees_all(topic->viewer) && parts_.roster != nullptr &&
          (topic->starts || tick_ % kTicksOfClients == 0))
        frames.push_back(frame_of("servers", servers_json(parts_)));
      if (!all || topic->starts || tick_ % kTicksOfAll == 0) look_at_jobs(*topic, frames, over);
      report(*topic, std::move(frames), over);
    }
  }
}

bool EventHub::wait_for_tick() {
  const auto next = Clock::now() + kTick;
  const MutexLock lock(mutex_);
  while (!stopping_ && topics_.empty()) wake_.wait(mutex_);  // no one watches
  while (!stopping_ && wake_.wait_until(mutex_, next) == std::cv_status::no_timeout) {
  }
  return !stopping_;
}

EventHub::Topics EventHub::take_topics() {
  const MutexLock lock(mutex_);
  Topics topics;
  for (const auto& [key, topic] : topics_) {
    if (topic->over) continue;
    topic->starts = std::exchange(topic->has_newcomer, false);
    topics.push_back(topic);
  }
  return topics;
}

// A new viewer of one job gets everything so far, and the others with it: the feed restarts. A new viewer of
// all jobs lists them itself.
void EventHub::look_at_jobs(Topic& topic, std::vector<Frame>& frames, bool& over) {
  const bool all = topic.job_id.empty();
  if (topic.feed == nullptr || (topic.starts && !all)) {
    v1::WatchJobsRequest request;
    request.set_job_id(topic.job_id);
    if (all) request.set_progress_interval_s(std::chrono::duration<double>(kTicksOfAll * kTick).count());
    auto feed = JobFeed::open(parts_.board, feeds_, topic.viewer, {}, request);
    if (feed) topic.feed = std::move(*feed);
    over = !feed;  // the job has been dropped meanwhile
    topic.skipped = 0;
  }
  v1::WatchJobsResponse response;
  if (!over && topic.feed->next(&response))
    frames.push_back(frame_of(all ? "jobs" : "job", to_json(response)));
  if (response.skipped() > topic.skipped) frames.push_back(frame_of("reload", "{}"));
  topic.skipped = std::max(topic.skipped, response.skipped());
  over = over || topic.feed->is_over();
  if (over) frames.push_back(frame_of("end", "{}"));
}

void EventHub::report(Topic& topic, std::vector<Frame> frames, bool over) {
  if (frames.empty()) return;
  const MutexLock lock(mutex_);
  topic.end += static_cast<std::int64_t>(frames.size());
  for (Frame& frame : frames) topic.frames.push_back(std::move(frame));
  while (topic.frames.size() > kKeptFrames) topic.frames.pop_front();
  topic.over = over;
  topic.reported->notify_all();
}

EventHub::Frame EventHub::server_frame() const {
  v1::Counters counters;
  fill_counters(parts_, &counters);
  nlohmann::json json = nlohmann::json::parse(to_json(counters));
  json["workers"] = parts_.scheduler.limits().workers;
  json["uptime_s"] = std::chrono::duration<double>(Clock::now() - parts_.started).count();
  json["state"] = parts_.scheduler.is_draining() ? "draining" : "serving";
  json["jobs_watchers"] = parts_.feeds.open();
  const LastMinute::Sum last_minute = parts_.scheduler.last_minute();
  json["answered_last_minute"] = last_minute.answered;
  json["solved_last_minute"] = last_minute.solved;
  const Latencies::Quantiles newest = parts_.scheduler.latencies(Latencies::kNewestSeconds);
  const Latencies::Quantiles minute = parts_.scheduler.latencies(Latencies::kSeconds);
  json["p50_s"] = newest.median_s;
  json["p99_s"] = newest.p99_s;
  json["p50_last_minute_s"] = minute.median_s;
  json["p99_last_minute_s"] = minute.p99_s;
  return frame_of("server", json.dump());
}

}  // namespace marble::server::http
