// Real threads under a simulated scheduler and clock: one runs at a time, which one follows from a seed, and
// time passes only while all of them wait. The program's own definitions of the C library's functions for
// threads, locks, conditions, clocks and sleeps do this (threads.cpp), so the code under test is the
// server's, unchanged.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace marble::simulation {

using Duration = std::chrono::nanoseconds;

/// Threads that end together: those of one server, which kill() stops as `kill -9` stops a process.
using Group = int;

struct Schedule {
  std::uint64_t seed = 1;
  double preemption = 0.05;      ///< probability that another thread runs on at a lock, an unlock or a signal
  double spurious_wakeup = 0.0;  ///< probability that a wait on a condition returns without a signal
};

/// Runs `main` as the first thread, in group 0, and returns when it does; threads that are left stay where
/// they are. Once per process. If no thread can ever run again, `stuck` is called with what each of them
/// waits for, and the process ends.
void run(const Schedule& schedule, const std::function<void()>& main,
         const std::function<void(const std::string& waits)>& stuck);

/// Simulated time since run() began.
[[nodiscard]] Duration now();

/// Random numbers that follow from the seed, in the order of the calls.
[[nodiscard]] std::uint64_t draw();
/// In [0, 1).
[[nodiscard]] double draw_share();

[[nodiscard]] Group new_group(std::string name);
[[nodiscard]] Group current_group();
/// Starts a thread of this group. Threads that a thread starts otherwise are of its own group.
void start(Group group, std::string name, std::function<void()> body);
/// No thread of the group runs again. Those that hold a lock first run until they hold none: libraries have
/// locks that all servers of this process share. Does not return if the caller is of the group.
void kill(Group group);
[[nodiscard]] bool is_alive(Group group);

/// A number that differs, in all likelihood, once any two runs differ: of every hand-over between threads.
[[nodiscard]] std::uint64_t digest();
/// Number of hand-overs between threads so far.
[[nodiscard]] std::int64_t hand_overs();

}  // namespace marble::simulation
