#include "dispatcher.h"

#include <algorithm>

namespace marble::load {
namespace {

Clock::duration duration_of(double seconds) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * std::min(seconds, 1e9)));
}

}  // namespace

Dispatcher::Dispatcher(const Plan& plan, const std::vector<LoadedEntry>& entries, Clock::time_point begin)
    : plan_(plan),
      entries_(entries),
      begin_(begin),
      measured_from_(begin + duration_of(plan.warm_up_s)),
      end_(plan.count > 0 ? Clock::time_point::max() : measured_from_ + duration_of(plan.duration_s)),
      next_variant_(std::make_unique<std::atomic<std::size_t>[]>(entries.size())) {
  double sum = 0.0;
  for (const LoadedEntry& entry : entries) shares_.push_back(sum += entry.entry.weight);
  for (double& share : shares_) share /= sum;
  for (int client = 0; client < plan.clients; ++client)
    engines_.emplace_back(plan.seed + 1000 * (1 + static_cast<std::uint64_t>(client)));
}

void Dispatcher::run(const Lanes& lanes, const std::stop_token& stop) {
  if (plan_.loop == Loop::open) {
    run_open(lanes, stop);
  } else {
    run_closed(lanes, stop);
  }
}

bool Dispatcher::over(Clock::time_point at) const {
  return stopping_ || at >= end_ || (plan_.count > 0 && sent_ >= plan_.count);
}

bool Dispatcher::claim(const Work& work) {
  if (!work.measured) return true;
  if (sent_.fetch_add(1) < plan_.count || plan_.count == 0) return true;
  --sent_;
  return false;
}

Work Dispatcher::make_work(std::mt19937_64& engine, std::size_t client, Clock::time_point intended) {
  Work work;
  const double choice = uniform(engine);
  while (work.entry + 1 < shares_.size() && choice >= shares_[work.entry]) ++work.entry;
  work.variant = next_variant_[work.entry]++ % entries_[work.entry].problems.size();
  work.client = client;
  work.intended = intended;
  work.measured = intended >= measured_from_;
  work.checked = uniform(engine) < plan_.check;
  return work;
}

void Dispatcher::send(const Lanes& lanes, Work& work) {
  work.sent = Clock::now();
  lanes.send(work);
}

bool Dispatcher::sleep_until(Clock::time_point at, const std::stop_token& stop) {
  // A condition variable wakes about 50 µs late, and a sleep is no better: good enough compared with a solve,
  // and reported as lag.
  const MutexLock lock(mutex_);
  while (!stop.stop_requested() && Clock::now() < at)
    changed_.wait_until(mutex_, stop, at, [&] { return Clock::now() >= at; });
  return !stop.stop_requested();
}

void Dispatcher::run_open(const Lanes& lanes, const std::stop_token& stop) {
  Arrivals arrivals(plan_.arrivals, plan_.rate_per_s, plan_.seed);
  std::size_t client = 0;
  while (true) {
    const Clock::time_point intended = begin_ + arrivals.next();
    if (over(intended) || !sleep_until(intended, stop)) return;
    Work work = make_work(engines_.front(), client++ % engines_.size(), intended);
    if (!claim(work)) return;
    {
      const MutexLock lock(mutex_);
      if (under_way_ >= plan_.in_flight) reached_limit_ = true;
      const auto room = [this]()
                            ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return under_way_ < plan_.in_flight; };
      if (!changed_.wait(mutex_, stop, room)) return;
      ++under_way_;
    }
    send(lanes, work);
  }
}

void Dispatcher::run_closed(const Lanes& lanes, const std::stop_token& stop) {
  {
    const MutexLock lock(mutex_);
    active_clients_ = plan_.clients;
  }
  for (int client = 0; client < plan_.clients; ++client)
    next_of_client(lanes, static_cast<std::size_t>(client));
  const MutexLock lock(mutex_);
  const auto idle = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return active_clients_ == 0; };
  if (plan_.count > 0) {
    changed_.wait(mutex_, stop, idle);
  } else {
    changed_.wait_until(mutex_, stop, end_, idle);
  }
  stopping_ = true;
}

void Dispatcher::next_of_client(const Lanes& lanes, std::size_t client) {
  thread_local bool sending = false;
  const Clock::time_point now = Clock::now();
  const auto leave = [this] {
    const MutexLock lock(mutex_);
    if (--active_clients_ == 0) changed_.notify_all();
  };
  // A request that is done while it is being sent was never sent: its client's stream has ended, and so has
  // it.
  if (sending || over(now)) return leave();
  Work work = make_work(engines_[client], client, now);
  if (!claim(work)) return leave();
  {
    const MutexLock lock(mutex_);
    ++under_way_;
  }
  sending = true;
  send(lanes, work);
  sending = false;
}

void Dispatcher::done(const Lanes& lanes, const Work& work) {
  if (plan_.loop == Loop::closed) next_of_client(lanes, work.client);
  const MutexLock lock(mutex_);
  --under_way_;
  if (under_way_ == 0 || under_way_ + 1 >= plan_.in_flight) changed_.notify_all();
}

bool Dispatcher::wait_for_answers(double patience_s, const std::stop_token& stop) {
  stopping_ = true;
  const MutexLock lock(mutex_);
  const auto all = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return under_way_ == 0; };
  return changed_.wait_for(mutex_, stop, duration_of(patience_s), all);
}

}  // namespace marble::load
