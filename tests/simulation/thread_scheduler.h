// The scheduler of the simulated threads. One thread runs at a time and has all of it; the others wait for
// their turn.
#pragma once

#include <dlfcn.h>
#include <pthread.h>
#include <semaphore.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <sstream>
#include <string>
#include <unordered_map>
#include <vector>

#include "random.h"
#include "threads.h"

namespace marble::simulation {

using Nanoseconds = std::int64_t;
constexpr Nanoseconds kNever = std::numeric_limits<Nanoseconds>::max();
constexpr Nanoseconds kSecond = 1'000'000'000;
constexpr Nanoseconds kBoot = 1000 * kSecond;            // monotonic time at the beginning
constexpr Nanoseconds kEpoch = 1'800'000'000 * kSecond;  // calendar time at the beginning
constexpr Nanoseconds kReading = 100;                    // what a look at the clock takes: loops on it end

enum class State { ready, blocked, finished, dead };

struct Thread {
  int id = 0;
  Group group = 0;
  std::string name;
  void* (*routine)(void*) = nullptr;
  void* argument = nullptr;
  sem_t go = {};
  State state = State::ready;
  Nanoseconds deadline = kNever;
  bool timed_out = false;
  std::deque<Thread*>* queue = nullptr;  // where it waits
  const char* waits_for = "";
  int held = 0;  // locks
  pthread_t handle = {};
  bool handle_known = false;
  std::deque<Thread*> joiners;
};

struct Lock {
  Thread* owner = nullptr;
  int depth = 0;
  int readers = 0;
  std::deque<Thread*> waiters;
};

class Scheduler;
extern Scheduler* scheduler;                 // null: nothing is simulated
extern constinit thread_local Thread* self;  // null: a thread that is not simulated

class Scheduler {
 public:
  Scheduler(const Schedule& schedule, std::function<void(const std::string&)> stuck)
      : schedule_(schedule), random_(schedule.seed), stuck_(std::move(stuck)) {
    groups_.push_back("clients");
    alive_.push_back(true);
  }

  Thread* add(Group group, std::string name, void* (*routine)(void*), void* argument) {
    auto thread = std::make_unique<Thread>();
    thread->id = static_cast<int>(all_.size());
    thread->group = group;
    thread->name = std::move(name);
    thread->routine = routine;
    thread->argument = argument;
    sem_init(&thread->go, 0, 0);
    all_.push_back(std::move(thread));
    living_.push_back(all_.back().get());
    return all_.back().get();
  }
  void begin(Thread* thread) { ready_.push_back(thread); }

  [[nodiscard]] Nanoseconds time() const { return now_; }
  Nanoseconds look_at_clock() { return now_ += kReading; }
  Random& random() { return random_; }

  // A point at which another thread may run on.
  void preemption_point() {
    if (killing_ >= 0 && self->group == killing_ ? self->held == 0 : random_.chance(schedule_.preemption))
      pass();
  }
  void pass() {
    if (ready_.empty() && killing_ < 0) return;
    ready_.push_back(self);
    switch_away();
  }

  // Waits in the queue until wake(), or until the deadline: false then.
  bool block(std::deque<Thread*>* queue, Nanoseconds deadline, const char* waits_for) {
    if (queue != nullptr) queue->push_back(self);
    self->queue = queue;
    self->state = State::blocked;
    self->deadline = deadline;
    self->timed_out = false;
    self->waits_for = waits_for;
    switch_away();
    return !self->timed_out;
  }
  void wake(Thread* thread) {
    if (thread->queue != nullptr) std::erase(*thread->queue, thread);
    thread->queue = nullptr;
    thread->state = State::ready;
    thread->deadline = kNever;
    ready_.push_back(thread);
  }
  Thread* any_of(const std::deque<Thread*>& queue) { return queue[random_.below(queue.size())]; }

  // The last of a thread: another one runs on, and this one is not waited for.
  void finish() {
    Thread* const ended = self;
    ended->state = State::finished;
    std::erase(living_, ended);
    while (!ended->joiners.empty()) wake(ended->joiners.front());
    self = nullptr;
    hand_over(ended, pick());
  }

  Group new_group(std::string name) {
    groups_.push_back(std::move(name));
    alive_.push_back(true);
    return static_cast<Group>(groups_.size()) - 1;
  }
  [[nodiscard]] bool is_alive(Group group) const { return alive_[static_cast<std::size_t>(group)]; }
  void kill(Group group) {
    killer_ = self;
    alive_[static_cast<std::size_t>(group)] = false;
    killing_ = group;
    const auto holds = [&](const Thread* t) { return t->group == group && t != self && t->held > 0; };
    while (std::ranges::any_of(ready_, holds)) {
      ready_.push_back(self);
      switch_away();
    }
    killing_ = -1;
    for (Thread* thread : std::vector<Thread*>(living_)) {
      if (thread->group != group) continue;
      if (thread->queue != nullptr) std::erase(*thread->queue, thread);
      std::erase(ready_, thread);
      std::erase(living_, thread);
      thread->state = State::dead;
    }
    if (self->group == group) switch_away();
  }

  // The newest: the C library uses the handle of a thread that has ended again.
  [[nodiscard]] Thread* by_handle(pthread_t handle) const {
    const auto found = std::find_if(all_.rbegin(), all_.rend(), [&](const auto& t) {
      return t->handle_known && pthread_equal(t->handle, handle) != 0;
    });
    return found == all_.rend() ? nullptr : found->get();
  }

  Lock& lock_of(const void* address) { return locks_[address]; }
  void drop_lock(const void* address) { locks_.erase(address); }
  std::deque<Thread*>& waiters_on(const void* address) { return queues_[address]; }
  void drop_waiters(const void* address) {
    if (const auto found = queues_.find(address); found != queues_.end() && found->second.empty())
      queues_.erase(found);
  }
  [[nodiscard]] const Schedule& schedule() const { return schedule_; }
  [[nodiscard]] std::uint64_t digest() const { return digest_; }
  [[nodiscard]] std::int64_t hand_overs() const { return hand_overs_; }

  [[noreturn]] void fail(const std::string& why) {
    std::ostringstream text;
    text << why << '\n';
    for (const Thread* thread : living_)
      text << "  " << groups_[static_cast<std::size_t>(thread->group)] << ": thread " << thread->id << " ("
           << thread->name << ") " << (thread->state == State::ready ? "could run" : thread->waits_for)
           << '\n';
    stuck_(text.str());
    std::fflush(nullptr);
    _exit(3);
  }

 private:
  // The next thread to run. While a group is killed, only those of it that hold a lock, then the one that
  // kills.
  Thread* pick() {
    if (killing_ >= 0) {
      const auto holds =
          std::ranges::find_if(ready_, [&](const Thread* t) { return t->group == killing_ && t->held > 0; });
      return taken(holds != ready_.end() ? holds : std::ranges::find(ready_, killer_));
    }
    if (ready_.empty()) pass_time();
    return taken(ready_.begin() + static_cast<std::ptrdiff_t>(random_.below(ready_.size())));
  }
  Thread* taken(std::vector<Thread*>::iterator at) {
    Thread* const thread = *at;
    *at = ready_.back();
    ready_.pop_back();
    return thread;
  }
  // To the next deadline.
  void pass_time() {
    Nanoseconds next = kNever;
    for (const Thread* thread : living_) next = std::min(next, thread->deadline);
    if (next == kNever) fail("no thread can ever run again");
    now_ = std::max(now_, next);
    for (Thread* thread : std::vector<Thread*>(living_)) {
      if (thread->deadline > now_) continue;
      wake(thread);
      thread->timed_out = true;
    }
  }
  void switch_away() {
    Thread* const from = self;
    hand_over(from, pick());
  }
  void hand_over(Thread* from, Thread* to) {
    ++hand_overs_;
    digest_ = (digest_ ^ static_cast<std::uint64_t>(to->id) ^ (static_cast<std::uint64_t>(now_) << 16)) *
              0x100000001b3ULL;
    if (from == to) return;
    const bool waits = from->state != State::finished;
    sem_post(&to->go);
    while (waits && sem_wait(&from->go) != 0) {
    }
  }

  const Schedule schedule_;
  Random random_;
  const std::function<void(const std::string&)> stuck_;
  Nanoseconds now_ = 0;
  std::vector<std::unique_ptr<Thread>> all_;
  std::vector<Thread*> living_, ready_;
  std::vector<std::string> groups_;
  std::vector<bool> alive_;
  std::unordered_map<const void*, Lock> locks_;
  std::unordered_map<const void*, std::deque<Thread*>> queues_;
  Group killing_ = -1;  // while it is killed
  Thread* killer_ = nullptr;
  std::uint64_t digest_ = 0xcbf29ce484222325ULL;
  std::int64_t hand_overs_ = 0;
};

// The C library's own function; `version`, where the library has an older one of the same name.
template <class Function>
Function* real(Function*& known, const char* name, const char* version = nullptr) {
  if (known == nullptr) {
    void* const found = version == nullptr ? dlsym(RTLD_NEXT, name) : dlvsym(RTLD_NEXT, name, version);
    known = reinterpret_cast<Function*>(found);
  }
  return known;
}

[[nodiscard]] inline bool simulated() { return scheduler != nullptr && self != nullptr; }

/// Makes the real thread of one that was added, and lets it run in its turn.
void create(Thread* thread, pthread_t* handle);

}  // namespace marble::simulation
