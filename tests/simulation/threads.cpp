#include "threads.h"

#include <dlfcn.h>
#include <linux/futex.h>
#include <pthread.h>
#include <semaphore.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <deque>
#include <limits>
#include <memory>
#include <random>
#include <sstream>
#include <unordered_map>
#include <vector>

namespace marble::simulation {
namespace {

using Nanoseconds = std::int64_t;
constexpr Nanoseconds kNever = std::numeric_limits<Nanoseconds>::max();
constexpr Nanoseconds kSecond = 1'000'000'000;
constexpr Nanoseconds kBoot = 1000 * kSecond;            // monotonic time at the beginning
constexpr Nanoseconds kEpoch = 1'800'000'000 * kSecond;  // calendar time at the beginning
constexpr Nanoseconds kReading = 100;                    // what a look at the clock takes: loops on it end
constexpr std::size_t kStackBytes = std::size_t{1} << 20;

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
Scheduler* scheduler = nullptr;
thread_local Thread* self = nullptr;

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
  std::uint64_t draw() { return random_(); }
  double share() { return static_cast<double>(random_() >> 11) * 0x1p-53; }

  // A point at which another thread may run on.
  void preemption_point() {
    if (killing_ >= 0 && self->group == killing_ ? self->held == 0 : share() < schedule_.preemption) pass();
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
  Thread* any_of(const std::deque<Thread*>& queue) { return queue[draw() % queue.size()]; }

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
  [[nodiscard]] int threads_of(Group group) const {
    return static_cast<int>(std::ranges::count(living_, group, &Thread::group));
  }

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
    return taken(ready_.begin() + static_cast<std::ptrdiff_t>(draw() % ready_.size()));
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
  std::mt19937_64 random_;
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

bool simulated() { return scheduler != nullptr && self != nullptr; }

Nanoseconds in_nanoseconds(const timespec& time) { return time.tv_sec * kSecond + time.tv_nsec; }
timespec in_timespec(Nanoseconds time) { return {time / kSecond, time % kSecond}; }
Nanoseconds base_of(clockid_t clock) {
  return clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE ? kEpoch : kBoot;
}
bool is_wall(clockid_t clock) {
  return clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE || clock == CLOCK_MONOTONIC ||
         clock == CLOCK_MONOTONIC_COARSE || clock == CLOCK_MONOTONIC_RAW || clock == CLOCK_BOOTTIME;
}

int acquire(pthread_mutex_t* mutex) {
  while (true) {
    Lock& lock = scheduler->lock_of(mutex);
    if (lock.owner == nullptr) {
      lock.owner = self;
      lock.depth = 1;
      ++self->held;
      return 0;
    }
    if (lock.owner == self) {
      if ((mutex->__data.__kind & 3) != PTHREAD_MUTEX_RECURSIVE)
        scheduler->fail("a thread locks a mutex twice");
      ++lock.depth;
      return 0;
    }
    scheduler->block(&lock.waiters, kNever, "waits for a mutex");
  }
}

// Waiters try again: who comes first has it.
void release(const void* mutex) {
  Lock& lock = scheduler->lock_of(mutex);
  if (lock.owner != self) scheduler->fail("a thread unlocks a mutex that it does not hold");
  if (--lock.depth > 0) return;
  --self->held;
  lock.owner = nullptr;
  if (lock.waiters.empty()) {
    scheduler->drop_lock(mutex);
  } else {
    scheduler->wake(scheduler->any_of(lock.waiters));
  }
}

int wait(pthread_cond_t* condition, pthread_mutex_t* mutex, Nanoseconds deadline) {
  release(mutex);
  bool signalled = true;
  if (scheduler->share() < scheduler->schedule().spurious_wakeup) {
    scheduler->pass();
  } else {
    signalled = scheduler->block(&scheduler->waiters_on(condition), deadline, "waits for a condition");
  }
  scheduler->drop_waiters(condition);
  (void)acquire(mutex);
  return signalled ? 0 : ETIMEDOUT;
}

int sleep_until(Nanoseconds time) {
  scheduler->block(nullptr, std::max(time, scheduler->time()), "sleeps");
  return 0;
}

long wait_on_futex(const int* address, int operation, int value, const timespec* timeout) {
  const int command = operation & ~(FUTEX_PRIVATE_FLAG | FUTEX_CLOCK_REALTIME);
  if (command == FUTEX_WAKE || command == FUTEX_WAKE_BITSET) {
    auto& waiters = scheduler->waiters_on(address);
    long woken = 0;
    for (; woken < value && !waiters.empty(); ++woken) scheduler->wake(scheduler->any_of(waiters));
    scheduler->drop_waiters(address);
    scheduler->preemption_point();
    return woken;
  }
  if (command != FUTEX_WAIT && command != FUTEX_WAIT_BITSET)
    scheduler->fail("an unknown operation on a futex");
  if (__atomic_load_n(address, __ATOMIC_SEQ_CST) != value) {
    errno = EAGAIN;
    return -1;
  }
  Nanoseconds deadline = kNever;
  if (timeout != nullptr) {
    const bool calendar = (operation & FUTEX_CLOCK_REALTIME) != 0;
    deadline = command == FUTEX_WAIT ? scheduler->time() + in_nanoseconds(*timeout)
                                     : in_nanoseconds(*timeout) - (calendar ? kEpoch : kBoot);
  }
  const bool woken = scheduler->block(&scheduler->waiters_on(address), deadline, "waits for a futex");
  scheduler->drop_waiters(address);
  if (woken) return 0;
  errno = ETIMEDOUT;
  return -1;
}

void* run_thread(void* given) {
  auto* const thread = static_cast<Thread*>(given);
  while (sem_wait(&thread->go) != 0) {
  }
  self = thread;
  void* const result = thread->routine(thread->argument);
  scheduler->finish();
  return result;
}

using Create = int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
Create* real_create = nullptr;

int create(Thread* thread, pthread_t* handle) {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, kStackBytes);
  const int status = real(real_create, "pthread_create")(&thread->handle, &attributes, run_thread, thread);
  pthread_attr_destroy(&attributes);
  if (status != 0) scheduler->fail("no more threads can be made");
  thread->handle_known = true;
  if (handle != nullptr) *handle = thread->handle;
  scheduler->begin(thread);
  return 0;
}

void* run_body(void* given) {
  const std::unique_ptr<std::function<void()>> body(static_cast<std::function<void()>*>(given));
  (*body)();
  return nullptr;
}

}  // namespace

void run(const Schedule& schedule, const std::function<void()>& main,
         const std::function<void(const std::string& waits)>& stuck) {
  // Never freed: threads that are left refer to it.
  scheduler = new Scheduler(schedule, stuck);  // NOLINT(cppcoreguidelines-owning-memory)
  self = scheduler->add(0, "main", nullptr, nullptr);
  main();
  self = nullptr;
}

Duration now() { return Duration(scheduler->time()); }
std::uint64_t draw() { return scheduler->draw(); }
double draw_share() { return scheduler->share(); }
Group new_group(std::string name) { return scheduler->new_group(std::move(name)); }
Group current_group() { return self->group; }
void start(Group group, std::string name, std::function<void()> body) {
  auto* const kept = new std::function<void()>(std::move(body));  // NOLINT(cppcoreguidelines-owning-memory)
  Thread* const thread = scheduler->add(group, std::move(name), run_body, kept);
  (void)create(thread, nullptr);
  pthread_detach(thread->handle);
  scheduler->preemption_point();
}
void kill(Group group) { scheduler->kill(group); }
bool is_alive(Group group) { return scheduler->is_alive(group); }
int threads_of(Group group) { return scheduler->threads_of(group); }
std::uint64_t digest() { return scheduler->digest(); }
std::int64_t hand_overs() { return scheduler->hand_overs(); }

}  // namespace marble::simulation

using namespace marble::simulation;

// In place of the C library's, for this program and for every library that it loads.
extern "C" {

int pthread_create(pthread_t* handle, const pthread_attr_t* attributes, void* (*routine)(void*),
                   void* argument) {
  if (!simulated()) return real(real_create, "pthread_create")(handle, attributes, routine, argument);
  (void)create(scheduler->add(self->group, self->name + "+", routine, argument), handle);
  scheduler->preemption_point();
  return 0;
}

int pthread_join(pthread_t handle, void** result) {
  static int (*known)(pthread_t, void**) = nullptr;
  if (simulated()) {
    if (Thread* const thread = scheduler->by_handle(handle); thread != nullptr) {
      while (thread->state != State::finished)
        scheduler->block(&thread->joiners, kNever, "waits for a thread's end");
      thread->handle_known = false;
    }
  }
  return real(known, "pthread_join")(handle, result);
}

int pthread_mutex_lock(pthread_mutex_t* mutex) {
  static int (*known)(pthread_mutex_t*) = nullptr;
  if (!simulated()) return real(known, "pthread_mutex_lock")(mutex);
  scheduler->preemption_point();
  return acquire(mutex);
}

int pthread_mutex_trylock(pthread_mutex_t* mutex) {
  static int (*known)(pthread_mutex_t*) = nullptr;
  if (!simulated()) return real(known, "pthread_mutex_trylock")(mutex);
  const Lock& lock = scheduler->lock_of(mutex);
  if (lock.owner != nullptr && lock.owner != self) return EBUSY;
  return lock.owner == self && (mutex->__data.__kind & 3) != PTHREAD_MUTEX_RECURSIVE ? EBUSY : acquire(mutex);
}

int pthread_mutex_unlock(pthread_mutex_t* mutex) {
  static int (*known)(pthread_mutex_t*) = nullptr;
  if (!simulated()) return real(known, "pthread_mutex_unlock")(mutex);
  release(mutex);
  scheduler->preemption_point();
  return 0;
}

int pthread_rwlock_rdlock(pthread_rwlock_t* given) {
  static int (*known)(pthread_rwlock_t*) = nullptr;
  if (!simulated()) return real(known, "pthread_rwlock_rdlock")(given);
  scheduler->preemption_point();
  while (scheduler->lock_of(given).owner != nullptr)
    scheduler->block(&scheduler->lock_of(given).waiters, kNever, "waits for a lock");
  ++scheduler->lock_of(given).readers;
  ++self->held;
  return 0;
}

int pthread_rwlock_wrlock(pthread_rwlock_t* given) {
  static int (*known)(pthread_rwlock_t*) = nullptr;
  if (!simulated()) return real(known, "pthread_rwlock_wrlock")(given);
  scheduler->preemption_point();
  while (scheduler->lock_of(given).owner != nullptr || scheduler->lock_of(given).readers > 0)
    scheduler->block(&scheduler->lock_of(given).waiters, kNever, "waits for a lock");
  scheduler->lock_of(given).owner = self;
  ++self->held;
  return 0;
}

int pthread_rwlock_unlock(pthread_rwlock_t* given) {
  static int (*known)(pthread_rwlock_t*) = nullptr;
  if (!simulated()) return real(known, "pthread_rwlock_unlock")(given);
  Lock& lock = scheduler->lock_of(given);
  if (lock.owner == self) {
    lock.owner = nullptr;
  } else {
    --lock.readers;
  }
  --self->held;
  while (!lock.waiters.empty()) scheduler->wake(lock.waiters.front());
  if (lock.readers == 0) scheduler->drop_lock(given);
  scheduler->preemption_point();
  return 0;
}

int pthread_cond_wait(pthread_cond_t* condition, pthread_mutex_t* mutex) {
  static int (*known)(pthread_cond_t*, pthread_mutex_t*) = nullptr;
  if (!simulated()) return real(known, "pthread_cond_wait", "GLIBC_2.3.2")(condition, mutex);
  return wait(condition, mutex, kNever);
}

int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* end) {
  static int (*known)(pthread_cond_t*, pthread_mutex_t*, const timespec*) = nullptr;
  if (!simulated()) return real(known, "pthread_cond_timedwait", "GLIBC_2.3.2")(condition, mutex, end);
  return wait(condition, mutex, in_nanoseconds(*end) - kEpoch);
}

int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock,
                           const timespec* end) {
  static int (*known)(pthread_cond_t*, pthread_mutex_t*, clockid_t, const timespec*) = nullptr;
  if (!simulated()) return real(known, "pthread_cond_clockwait")(condition, mutex, clock, end);
  return wait(condition, mutex, in_nanoseconds(*end) - base_of(clock));
}

int pthread_cond_signal(pthread_cond_t* condition) {
  static int (*known)(pthread_cond_t*) = nullptr;
  if (!simulated()) return real(known, "pthread_cond_signal", "GLIBC_2.3.2")(condition);
  auto& waiters = scheduler->waiters_on(condition);
  if (!waiters.empty()) scheduler->wake(scheduler->any_of(waiters));
  scheduler->drop_waiters(condition);
  scheduler->preemption_point();
  return 0;
}

int pthread_cond_broadcast(pthread_cond_t* condition) {
  static int (*known)(pthread_cond_t*) = nullptr;
  if (!simulated()) return real(known, "pthread_cond_broadcast", "GLIBC_2.3.2")(condition);
  auto& waiters = scheduler->waiters_on(condition);
  while (!waiters.empty()) scheduler->wake(waiters.front());
  scheduler->drop_waiters(condition);
  scheduler->preemption_point();
  return 0;
}

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  static int (*known)(clockid_t, timespec*) = nullptr;
  if (!simulated()) return real(known, "clock_gettime")(clock, time);
  const Nanoseconds now = scheduler->look_at_clock();
  *time = in_timespec(is_wall(clock) ? base_of(clock) + now : now);
  return 0;
}

int gettimeofday(timeval* time, void* /*zone*/) noexcept {
  timespec now = {};
  (void)clock_gettime(CLOCK_REALTIME, &now);
  *time = {now.tv_sec, now.tv_nsec / 1000};
  return 0;
}

time_t time(time_t* also) noexcept {
  timespec now = {};
  (void)clock_gettime(CLOCK_REALTIME, &now);
  if (also != nullptr) *also = now.tv_sec;
  return now.tv_sec;
}

int clock_nanosleep(clockid_t clock, int flags, const timespec* duration, timespec* left) {
  static int (*known)(clockid_t, int, const timespec*, timespec*) = nullptr;
  if (!simulated()) return real(known, "clock_nanosleep")(clock, flags, duration, left);
  return sleep_until((flags & TIMER_ABSTIME) != 0 ? in_nanoseconds(*duration) - base_of(clock)
                                                  : scheduler->time() + in_nanoseconds(*duration));
}

int nanosleep(const timespec* duration, timespec* left) {
  return clock_nanosleep(CLOCK_MONOTONIC, 0, duration, left);
}

int usleep(useconds_t duration) {
  const timespec time = in_timespec(Nanoseconds{duration} * 1000);
  return nanosleep(&time, nullptr);
}

int sched_yield() noexcept {
  static int (*known)() = nullptr;
  if (!simulated()) return real(known, "sched_yield")();
  (void)scheduler->look_at_clock();
  scheduler->pass();
  return 0;
}

long syscall(long number, ...) noexcept {
  static long (*known)(long, ...) = nullptr;
  va_list list;
  va_start(list, number);
  long a[6] = {};
  for (long& argument : a) argument = va_arg(list, long);
  va_end(list);
  if (number != SYS_futex || !simulated())
    return real(known, "syscall")(number, a[0], a[1], a[2], a[3], a[4], a[5]);
  return wait_on_futex(reinterpret_cast<const int*>(a[0]), static_cast<int>(a[1]), static_cast<int>(a[2]),
                       reinterpret_cast<const timespec*>(a[3]));
}

}  // extern "C"
