#include "simulation.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <queue>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "jobs/job_queue.h"

namespace marble::fleet_sim {

namespace {

// Selects the server of the next call. It knows only how many calls each has in progress, as a proxy does.
class Balancer {
 public:
  Balancer(Balance kind, std::uint64_t seed) : kind_(kind), random_(seed) {}

  void add_server() {
    by_load_.emplace(0, static_cast<int>(load_.size()));
    load_.push_back(0);
  }

  [[nodiscard]] int choose() {
    switch (kind_) {
      case Balance::least: {
        // Rotates among the servers with the fewest calls: takes the first one after the last one taken.
        const int least = by_load_.begin()->first;
        auto next = by_load_.lower_bound({least, next_});
        if (next == by_load_.end() || next->first != least) next = by_load_.begin();
        next_ = next->second + 1;
        return next->second;
      }
      case Balance::two: {
        const int first = any(), second = any();
        return load_[first] <= load_[second] ? first : second;
      }
      case Balance::round_robin:
        return next_ = (next_ + 1) % static_cast<int>(load_.size());
      case Balance::random:
        return any();
    }
    return 0;
  }

  void add_call(int server) { change(server, 1); }
  void end_call(int server) { change(server, -1); }

 private:
  int any() { return std::uniform_int_distribution<int>(0, static_cast<int>(load_.size()) - 1)(random_); }
  void change(int server, int by) {
    if (kind_ == Balance::least) {
      by_load_.erase({load_[server], server});
      by_load_.emplace(load_[server] + by, server);
    }
    load_[server] += by;
  }

  Balance kind_;
  std::mt19937_64 random_;
  std::vector<int> load_;
  std::set<std::pair<int, int>> by_load_;
  int next_ = 0;
};

using Queue = server::JobQueue<struct Job>;
using Instant = Queue::Time;

Instant instant(double s) {
  return Instant(std::chrono::duration_cast<Instant::duration>(std::chrono::duration<double>(s)));
}

struct Job {
  int planner = 0;
  int server = 0;
  double tick_s = 0.0;     // when the planner sent it
  double arrival_s = 0.0;  // at the server
  double service_s = 0.0;
};

using JobPtr = std::shared_ptr<Job>;

enum class Kind { tick, arrive, finish, answer, poll, open };

struct Event {
  double time_s = 0.0;
  std::uint64_t number = 0;  // older jobs go first
  Kind kind = Kind::tick;
  int planner = 0;
  JobPtr job;
  bool operator>(const Event& other) const {
    return time_s != other.time_s ? time_s > other.time_s : number > other.number;
  }
};

struct Server {
  explicit Server(int workers) : queue({workers, 1'000'000'000, std::int64_t{1} << 60}) {}
  Queue queue;
  std::int64_t served = 0;
};

struct Planner {
  int server = -1;  // of its session
  JobPtr waiting;   // its session's update that has not started
  bool running = false;
  bool has_next = false;  // a control step came while the last one ran
  double next_tick_s = 0.0;
};

class Simulation {
 public:
  explicit Simulation(const Plan& plan)
      : plan_(plan), random_(plan.seed), balancer_(plan.balance, plan.seed + 1), planners_(plan.planners) {}

  Outcome run() {
    for (int i = 0; i < plan_.servers; ++i) open_server();
    wanted_ = plan_.servers;
    place_sessions();
    if (plan_.recorded.empty()) {
      start_planners();
    } else {
      replay();
    }
    if (plan_.autoscaler.poll_s > 0.0) push(plan_.autoscaler.poll_s, Kind::poll);
    const double end_s = plan_.warm_s + plan_.run_s;
    while (!events_.empty() && events_.top().time_s < end_s) {
      const Event event = events_.top();
      events_.pop();
      count_busy(event.time_s);
      now_s_ = event.time_s;
      handle(event);
    }
    count_busy(end_s);
    return finish();
  }

 private:
  void push(double at_s, Kind kind, int planner = 0, JobPtr job = nullptr) {
    events_.push({at_s, next_number_++, kind, planner, std::move(job)});
  }

  void handle(const Event& event) {
    switch (event.kind) {
      case Kind::tick:
        tick(event.planner);
        break;
      case Kind::arrive:
        arrive(event.job);
        break;
      case Kind::finish:
        end(event.job);
        break;
      case Kind::answer:
        answer(event.job);
        break;
      case Kind::poll:
        poll();
        break;
      case Kind::open:
        open_server();
        break;
    }
  }

  void open_server() {
    servers_.emplace_back(plan_.workers);
    balancer_.add_server();
  }

  // Sessions are long-lived: the balancer sees them as calls in progress, and places each once.
  void place_sessions() {
    if (!plan_.sessions) return;
    for (Planner& planner : planners_) {
      planner.server = balancer_.choose();
      balancer_.add_call(planner.server);
    }
  }

  void start_planners() {
    const double period_s = plan_.rate_hz > 0.0 ? 1.0 / plan_.rate_hz : 0.001;
    std::uniform_real_distribution<double> phase(0.0, period_s);
    const auto at_start = static_cast<int>(std::lround(plan_.ramp_from * plan_.planners));
    for (int i = 0; i < plan_.planners; ++i) {
      const bool later = plan_.ramp_s > 0.0 && i >= at_start;
      const double comes_s =
          later ? plan_.warm_s + plan_.ramp_s * (i - at_start) / (plan_.planners - at_start) : 0.0;
      push(comes_s + phase(random_), Kind::tick, i);
    }
  }

  void replay() {
    planners_.resize(plan_.recorded.size());
    int planner = 0;
    for (const Recorded& recorded : plan_.recorded) {
      auto job = std::make_shared<Job>();
      job->planner = planner++;
      job->tick_s = recorded.arrival_s;
      job->service_s = recorded.service_s;
      balancer_.add_call(0);
      push(recorded.arrival_s, Kind::arrive, job->planner, job);
    }
  }

  [[nodiscard]] bool counted(const Job& job) const { return job.tick_s >= plan_.warm_s; }

  void tick(int planner) {
    if (plan_.rate_hz > 0.0) push(now_s_ + 1.0 / plan_.rate_hz, Kind::tick, planner);
    if (now_s_ >= plan_.warm_s) ++outcome_.ticks;
    auto job = std::make_shared<Job>();
    job->planner = planner;
    job->tick_s = now_s_;
    job->service_s = service_time();
    job->server = plan_.sessions ? planners_[planner].server : balancer_.choose();
    if (!plan_.sessions) balancer_.add_call(job->server);
    push(now_s_ + plan_.network_s, Kind::arrive, planner, job);
  }

  void arrive(const JobPtr& job) {
    Planner& planner = planners_[job->planner];
    if (plan_.sessions && planner.waiting) {  // replaces the waiting one
      if (counted(*planner.waiting)) ++outcome_.superseded;
      planner.waiting->tick_s = job->tick_s;
      return;
    }
    if (plan_.sessions && planner.running) {
      if (planner.has_next && planner.next_tick_s >= plan_.warm_s) ++outcome_.superseded;
      planner.has_next = true;
      planner.next_tick_s = job->tick_s;
      return;
    }
    enter(job);
  }

  void enter(const JobPtr& job) {
    job->arrival_s = now_s_;
    server::Ticket ticket;
    ticket.client = std::to_string(job->planner);
    ticket.priority = server::Priority::realtime;
    ticket.arrival = instant(now_s_);
    if (plan_.deadline_s > 0.0) ticket.deadline = instant(job->tick_s + plan_.deadline_s);
    ticket.reserved = plan_.sessions;
    static_cast<void>(servers_[job->server].queue.push(job, ticket, {}));
    if (plan_.sessions) planners_[job->planner].waiting = job;
    start_next(job->server);
  }

  void start_next(int at) {
    Server& server = servers_[at];
    while (server.queue.running() < plan_.workers) {
      const JobPtr job = server.queue.pop();
      if (!job) return;
      Planner& planner = planners_[job->planner];
      if (plan_.sessions) planner.waiting.reset();
      if (plan_.deadline_s > 0.0 && now_s_ > job->tick_s + plan_.deadline_s) {  // too late: rejected, not run
        server.queue.done(job.get());
        if (counted(*job)) ++outcome_.late;
        leave(*job);
        continue;
      }
      if (counted(*job)) outcome_.wait_s.push_back(now_s_ - job->arrival_s);
      planner.running = plan_.sessions;
      ++busy_;
      const double slow = at == 0 ? plan_.slow_factor : 1.0;
      push(now_s_ + slow * job->service_s + plan_.overhead_s, Kind::finish, job->planner, job);
    }
  }

  double service_time() {
    return plan_
        .service_s[std::uniform_int_distribution<std::size_t>(0, plan_.service_s.size() - 1)(random_)];
  }

  void end(const JobPtr& job) {
    --busy_;
    Server& server = servers_[job->server];
    server.queue.done(job.get());
    if (counted(*job)) ++server.served;
    push(now_s_ + plan_.network_s, Kind::answer, job->planner, job);
    if (plan_.sessions) {
      Planner& planner = planners_[job->planner];
      planner.running = false;
      if (planner.has_next) {
        planner.has_next = false;
        auto next = std::make_shared<Job>(*job);
        next->tick_s = planner.next_tick_s;
        next->service_s = service_time();
        enter(next);
      }
    }
    start_next(job->server);
  }

  void answer(const JobPtr& job) {
    if (counted(*job)) {
      const double total_s = now_s_ - job->tick_s;
      outcome_.total_s.push_back(total_s);
      ++(plan_.deadline_s > 0.0 && total_s > plan_.deadline_s ? outcome_.late : outcome_.answered);
    }
    leave(*job);
  }

  // Ends the call for the balancer and for its planner.
  void leave(const Job& job) {
    if (!plan_.sessions) balancer_.end_call(job.server);
    if (plan_.rate_hz <= 0.0 && plan_.recorded.empty()) push(now_s_, Kind::tick, job.planner);
  }

  void poll() {
    const Autoscaler& scaler = plan_.autoscaler;
    push(now_s_ + scaler.poll_s, Kind::poll);
    history_.emplace_back(now_s_, busy_s_);
    while (history_.size() > 2 && now_s_ - history_[1].first >= scaler.window_s) history_.pop_front();
    const double elapsed_s = now_s_ - history_.front().first;
    if (elapsed_s <= 0.0) return;
    const double busy = (busy_s_ - history_.front().second) / elapsed_s;
    const int wanted = std::min(static_cast<int>(std::ceil(busy / scaler.target)), 2 * wanted_);
    for (; wanted_ < wanted; ++wanted_) push(now_s_ + scaler.start_s, Kind::open);
  }

  void count_busy(double until_s) {
    const double from_s = std::max(now_s_, plan_.warm_s);
    if (until_s > from_s) {
      counted_busy_s_ += busy_ * (until_s - from_s);
      worker_s_ += static_cast<double>(servers_.size()) * plan_.workers * (until_s - from_s);
    }
    busy_s_ += busy_ * (until_s - now_s_);
  }

  Outcome finish() {
    std::sort(outcome_.wait_s.begin(), outcome_.wait_s.end());
    std::sort(outcome_.total_s.begin(), outcome_.total_s.end());
    outcome_.busy = worker_s_ > 0.0 ? counted_busy_s_ / worker_s_ : 0.0;
    outcome_.servers_at_end = static_cast<int>(servers_.size());
    for (const Server& server : servers_) outcome_.served.push_back(server.served);
    return std::move(outcome_);
  }

  const Plan& plan_;
  std::mt19937_64 random_;
  Balancer balancer_;
  std::vector<Planner> planners_;
  std::deque<Server> servers_;
  std::priority_queue<Event, std::vector<Event>, std::greater<>> events_;
  std::uint64_t next_number_ = 0;
  double now_s_ = 0.0;
  int busy_ = 0;
  int wanted_ = 0;
  double busy_s_ = 0.0, counted_busy_s_ = 0.0, worker_s_ = 0.0;
  std::deque<std::pair<double, double>> history_;  // time, busy_s_
  Outcome outcome_;
};

}  // namespace

const std::vector<std::string>& balance_names() {
  static const std::vector<std::string> names = {"least", "two", "round_robin", "random"};
  return names;
}

double quantile(const std::vector<double>& sorted, double share) {
  if (sorted.empty()) return 0.0;
  const auto at = static_cast<std::size_t>(share * static_cast<double>(sorted.size()));
  return sorted[std::min(at, sorted.size() - 1)];
}

Outcome simulate(const Plan& plan) { return Simulation(plan).run(); }

}  // namespace marble::fleet_sim
