// In place of the C library's functions, for this program and for every library that it loads.
#include <linux/futex.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <ctime>

#include "thread_scheduler.h"

namespace marble::simulation {
namespace {

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
  if (scheduler->random().chance(scheduler->schedule().spurious_wakeup)) {
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

}  // namespace
}  // namespace marble::simulation

using namespace marble::simulation;

extern "C" {

int pthread_create(pthread_t* handle, const pthread_attr_t* attributes, void* (*routine)(void*),
                   void* argument) {
  static int (*known)(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*) = nullptr;
  if (!simulated()) return real(known, "pthread_create")(handle, attributes, routine, argument);
  create(scheduler->add(self->group, self->name + "+", routine, argument), handle);
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
