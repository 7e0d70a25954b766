// The queue as a pure data structure: which job is next, and which must be refused. No threads, no clock.
//
// A higher priority goes first; one that was passed over `starvation_limit` times in a row, or for
// `starvation_time`, goes once in between. Within a priority, clients take turns. Within a client, the
// earliest deadline goes first, then the order of arrival; a job without a deadline, or with a distant one,
// counts as due `patience` after its arrival, so that it does not starve.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <numeric>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/quota.h"
#include "jobs/starvation_limit.h"

namespace marble::server {

struct QueueLimits {
  int workers = 1;            ///< a free worker counts as capacity, so jobs = 0 means "no waiting"
  int jobs = 0;               ///< limit on waiting jobs; one place in 16 is reserved for realtime jobs
  std::int64_t bytes = 0;     ///< limit on requests that wait, in queue or session, or run
  int starvation_limit = 32;  ///< how often in a row a priority with waiting jobs may be passed over
  std::chrono::steady_clock::duration starvation_time = std::chrono::seconds(1);  ///< or for how long
  std::chrono::steady_clock::duration patience = std::chrono::seconds(10);

  /// Returns how many jobs may wait when a job of this priority arrives. Other jobs never fill the queue, so
  /// a control loop is not refused because another client floods the server.
  [[nodiscard]] int jobs_for(Priority priority) const {
    return priority == Priority::realtime ? jobs : jobs - jobs / 16;
  }
};

/// What the queue needs to know about an item.
struct Ticket {
  std::string client;
  Priority priority = Priority::interactive;
  std::chrono::steady_clock::time_point deadline = std::chrono::steady_clock::time_point::max();
  std::chrono::steady_clock::time_point arrival = {};
  std::chrono::steady_clock::duration least_run = {};  ///< it is not begun with less time left
  double expected_run_s = 0.0;                         ///< estimate; 0 if unknown
  int work_class = 0;  ///< jobs of one client, priority and class run for about as long
  std::int64_t bytes = 0;
  bool reserved = false;     ///< an update of a session: its place was reserved with the session
  bool placed = false;       ///< element of an array, which has its place: take_place()
  bool may_preempt = false;  ///< it may preempt an item of a lower priority: its memory is not its worker's

  /// True if the item counts against the number of items that may wait.
  [[nodiscard]] bool takes_place() const { return !reserved && !placed; }
};

/// Why an item is refused.
enum class QueueRefusal { none, jobs, bytes, client_jobs, client_bytes };

/// Items wait until pop(), then run until done(). Each is identified by its address.
template <class Item>
class JobQueue {
 public:
  using Time = std::chrono::steady_clock::time_point;
  using Ahead = std::array<std::size_t, kPriorities>;

  explicit JobQueue(const QueueLimits& limits)
      : limits_(limits), starvation_limit_(limits.starvation_limit, limits.starvation_time) {}

  /// Takes the item, or returns why not; the caller then keeps it. The client's newest quota applies.
  [[nodiscard]] QueueRefusal push(std::shared_ptr<Item> item, const Ticket& ticket, const Quota& quota) {
    const auto known = clients_.find(ticket.client);
    const Client& client = known == clients_.end() ? kNobody : known->second;
    if (ticket.takes_place()) {
      if (!has_room(ticket.priority)) return QueueRefusal::jobs;
      const bool runs_at_once = client.running < quota.running && running_ < limits_.workers;
      if (client.queued >= quota.queued && !(runs_at_once && client.queued == 0))
        return QueueRefusal::client_jobs;
    }
    if (ticket.bytes > limits_.bytes - bytes_) return QueueRefusal::bytes;
    if (ticket.bytes > quota.bytes - client.bytes) return QueueRefusal::client_bytes;
    Client& owner = clients_[ticket.client];
    owner.quota = quota;
    owner.bytes += ticket.bytes;
    bytes_ += ticket.bytes;
    if (ticket.takes_place()) {
      ++unreserved_;
      ++owner.queued;
    }
    const auto at = static_cast<std::size_t>(ticket.priority);
    Line& line = owner.lines[at];
    if (line.empty()) owner.turns[at] = turns_[at].insert(turns_[at].end(), &owner);
    const Key key{std::min(ticket.deadline, ticket.arrival + limits_.patience), next_number_++};
    Known& taken = tickets_.emplace(item.get(), Known{ticket, &owner, key, false, {}}).first->second;
    if (ticket.deadline != Time::max()) deadlines_.emplace(latest_begin(ticket), item.get());
    const auto place = line.emplace(key, Waiting{std::move(item), ticket.expected_run_s}).first;
    lengthen(at, line.size());
    work_s_[at] += ticket.expected_run_s;
    owner.work_s[at] += ticket.expected_run_s;
    ++waiting_[at];
    if (ticket.may_preempt) ++preempting_[at];
    taken.before = most_before(at, owner, place);
    return QueueRefusal::none;
  }

  /// Takes the place of an array, which counts as one waiting item until leave_place(), and the bytes of its
  /// elements. With `always`, limits are ignored: for arrays that were accepted before the limits were
  /// lowered.
  [[nodiscard]] QueueRefusal take_place(const std::string& client, Priority priority, const Quota& quota,
                                        bool always) {
    const auto known = clients_.find(client);
    const Client& owner = known == clients_.end() ? kNobody : known->second;
    if (!always && !has_room(priority)) return QueueRefusal::jobs;
    const bool runs_at_once =
        owner.queued == 0 && owner.running < quota.running && running_ < limits_.workers;
    if (!always && owner.queued >= quota.queued && !runs_at_once) return QueueRefusal::client_jobs;
    Client& taken = clients_[client];
    taken.quota = quota;
    ++taken.places;
    ++taken.queued;
    ++unreserved_;
    return QueueRefusal::none;
  }
  [[nodiscard]] QueueRefusal add_bytes(const std::string& client, std::int64_t bytes, const Quota& quota,
                                       bool always) {
    Client& owner = clients_.at(client);
    if (!always && bytes > limits_.bytes - bytes_) return QueueRefusal::bytes;
    if (!always && bytes > quota.bytes - owner.bytes) return QueueRefusal::client_bytes;
    owner.bytes += bytes;
    bytes_ += bytes;
    return QueueRefusal::none;
  }
  void remove_bytes(const std::string& client, std::int64_t bytes) {
    clients_.at(client).bytes -= bytes;
    bytes_ -= bytes;
  }
  void leave_place(const std::string& client) {
    const auto owner = clients_.find(client);
    --owner->second.places;
    --owner->second.queued;
    --unreserved_;
    forget_if_idle(owner);
  }

  /// Counts bytes that wait for their turn outside the queue, until they are released. All of them together
  /// are at most half of what may wait, those of one client a quarter, so that clients whose turn does not
  /// come leave capacity for the others. False if the bytes exceed a limit.
  [[nodiscard]] bool hold(const std::string& client, std::int64_t bytes, const Quota& quota) {
    const auto known = clients_.find(client);
    const Client& owner = known == clients_.end() ? kNobody : known->second;
    const bool fits = bytes <= limits_.bytes - bytes_ && bytes <= limits_.bytes / 2 - held_ &&
                      bytes <= limits_.bytes / 4 - owner.held && bytes <= quota.bytes - owner.bytes;
    if (fits) count_held(clients_[client], bytes);
    return fits;
  }
  void release(const std::string& client, std::int64_t bytes) {
    const auto owner = clients_.find(client);
    count_held(owner->second, -bytes);
    forget_if_idle(owner);
  }

  /// Returns the next item that may run, and marks it as running; null if there is none. Without a time,
  /// only turns count.
  [[nodiscard]] std::shared_ptr<Item> pop(Time now = Time()) {
    const std::size_t at = choose_priority(now);
    if (at == kPriorities) return nullptr;
    const auto turn = find_turn(at);
    return take(at, turn, tickets_.at((*turn)->lines[at].begin()->second.item.get()));
  }

  /// Returns the next item of a priority above this one that may preempt and run, and marks it as running;
  /// null if there is none.
  [[nodiscard]] std::shared_ptr<Item> pop_above(Priority priority) {
    for (std::size_t at = 0; at < static_cast<std::size_t>(priority); ++at) {
      if (preempting_[at] == 0) continue;
      for (auto turn = turns_[at].begin(); turn != turns_[at].end(); ++turn) {
        const Client& client = **turn;
        if (client.running >= client.quota.running) continue;
        for (const auto& [key, waiting] : client.lines[at]) {
          Known& known = tickets_.at(waiting.item.get());
          if (known.ticket.may_preempt) return take(at, turn, known);
        }
      }
    }
    return nullptr;
  }
  /// Returns the highest priority at which an item that may preempt waits; kPriorities if there is none.
  [[nodiscard]] std::size_t most_urgent() const {
    const auto some = [](std::size_t count) { return count > 0; };
    return static_cast<std::size_t>(std::find_if(preempting_.begin(), preempting_.end(), some) -
                                    preempting_.begin());
  }

  /// A popped item has ended.
  void done(const Item* item) {
    const auto found = tickets_.find(item);
    --found->second.client->running;
    --running_;
    forget(found);
  }

  /// Removes the item if it is waiting; returns whether it was.
  bool remove(const Item* item) {
    const auto found = tickets_.find(item);
    if (found == tickets_.end() || found->second.running) return false;
    static_cast<void>(take_out(found));
    return true;
  }

  /// Removes and returns waiting items that can no longer meet their deadline; with the maximum time, all of
  /// them.
  [[nodiscard]] std::vector<std::shared_ptr<Item>> expire(Time now) {
    std::vector<std::shared_ptr<Item>> late;
    if (now == Time::max()) {
      for (auto known = tickets_.begin(); known != tickets_.end();) {
        const auto next = std::next(known);
        if (!known->second.running) late.push_back(take_out(known));
        known = next;
      }
      return late;
    }
    while (!deadlines_.empty() && deadlines_.begin()->first <= now)
      late.push_back(take_out(tickets_.find(deadlines_.begin()->second)));
    return late;
  }

  /// Computes for every waiting item which of its priority will be taken before it if nothing arrives or
  /// leaves, in one sweep over all items.
  void update_places() {
    for (std::size_t at = 0; at < kPriorities; ++at) {
      std::vector<std::pair<typename Line::const_iterator, const Line*>> round;
      round.reserve(turns_[at].size());
      for (const Client* client : turns_[at])
        round.emplace_back(client->lines[at].begin(), &client->lines[at]);
      for (Before before; !round.empty();) {
        for (auto& [next, line] : round) {
          const Waiting& waiting = (next++)->second;
          tickets_.at(waiting.item.get()).before = before;
          ++before.items;
          before.work_s += waiting.run_s;
        }
        std::erase_if(round, [](const auto& turn) { return turn.first == turn.second->end(); });
      }
    }
  }

  /// Returns how many items of each priority will be taken before this waiting item; zeros for other items.
  /// As of the last update_places(), or, for an item that arrived after it, an upper bound.
  [[nodiscard]] Ahead ahead_of(const Item* item) const {
    Ahead ahead = {};
    const auto found = tickets_.find(item);
    if (found == tickets_.end() || found->second.running) return ahead;
    const auto own = static_cast<std::size_t>(found->second.ticket.priority);
    for (std::size_t at = 0; at < own; ++at) ahead[at] = waiting_[at];
    ahead[own] = found->second.before.items;
    return ahead;
  }
  /// Returns the expected total run time of these items; 0 for an item that does not wait. Of one that
  /// arrived after the last update_places(), it is exact for the items of its own client, and at their mean
  /// for the others.
  [[nodiscard]] double work_ahead_s(const Item* item) const {
    const auto found = tickets_.find(item);
    if (found == tickets_.end() || found->second.running) return 0.0;
    const auto own = static_cast<std::ptrdiff_t>(found->second.ticket.priority);
    return std::accumulate(work_s_.begin(), work_s_.begin() + own, found->second.before.work_s);
  }

  /// Calls `report` for every client in the queue with its name, and how much of it waits and runs.
  template <class Report>
  void each_client(const Report& report) const {
    for (const auto& [name, client] : clients_) {
      std::size_t waiting = 0;
      for (const Line& line : client.lines) waiting += line.size();
      report(name, static_cast<int>(waiting), client.running);
    }
  }

  [[nodiscard]] bool is_waiting(const Item* item) const {
    const auto found = tickets_.find(item);
    return found != tickets_.end() && !found->second.running;
  }
  [[nodiscard]] std::size_t waiting() const { return std::accumulate(waiting_.begin(), waiting_.end(), 0UL); }
  [[nodiscard]] const Ahead& waiting_by_priority() const { return waiting_; }
  /// Returns the expected total run time of the waiting items, by priority.
  [[nodiscard]] const std::array<double, kPriorities>& work_s() const { return work_s_; }
  [[nodiscard]] int running() const { return running_; }
  [[nodiscard]] std::int64_t bytes() const { return bytes_; }
  [[nodiscard]] std::size_t clients() const { return clients_.size(); }  ///< with waiting or running items
  /// True if a job of size zero would be taken.
  [[nodiscard]] bool has_room(Priority priority) const {
    return unreserved_ < limits_.jobs_for(priority) + limits_.workers;
  }
  /// True if pop() would return an item.
  [[nodiscard]] bool ready() const {
    for (std::size_t at = 0; at < kPriorities; ++at) {
      if (find_turn(at) != turns_[at].end()) return true;
    }
    return false;
  }

 private:
  using Key = std::pair<Time, std::int64_t>;  // when the item is due, then the order of arrival
  struct Waiting {
    std::shared_ptr<Item> item;
    double run_s;  // expected
  };
  using Line = std::map<Key, Waiting>;
  struct Client;
  using Turns = std::list<Client*>;
  struct Client {
    Quota quota;
    int queued = 0, running = 0;       // queued: items that take a place, and places
    int places = 0;                    // places of arrays
    std::int64_t bytes = 0, held = 0;  // bytes: including held bytes
    std::array<Line, kPriorities> lines;
    std::array<double, kPriorities> work_s = {};              // of the lines
    std::array<typename Turns::iterator, kPriorities> turns;  // of priorities with a non-empty line
  };
  // Those of an item's priority that are taken before it.
  struct Before {
    std::size_t items = 0;
    double work_s = 0.0;
  };
  struct Known {
    Ticket ticket;
    Client* client;
    Key key;
    bool running;
    Before before;
  };
  using Tickets = std::map<const Item*, Known>;
  [[nodiscard]] auto find_turn(std::size_t at) const {
    return std::find_if(turns_[at].begin(), turns_[at].end(),
                        [](const Client* client) { return client->running < client->quota.running; });
  }

  // Also counts the priorities that were passed over.
  [[nodiscard]] std::size_t choose_priority(Time now) {
    std::array<bool, kPriorities> able = {};
    for (std::size_t at = 0; at < kPriorities; ++at) able[at] = find_turn(at) != turns_[at].end();
    return starvation_limit_.choose(able, now);
  }

  [[nodiscard]] static Time latest_begin(const Ticket& ticket) { return ticket.deadline - ticket.least_run; }

  std::shared_ptr<Item> take(std::size_t at, typename Turns::const_iterator turn, Known& known) {
    turns_[at].splice(turns_[at].end(), turns_[at], turn);
    std::shared_ptr<Item> item = leave_line(known);
    known.running = true;
    ++known.client->running;
    ++running_;
    return item;
  }

  // A line has grown to this length.
  void lengthen(std::size_t at, std::size_t length) {
    if (at_least_[at].size() < length) at_least_[at].resize(length, 0);
    ++at_least_[at][length - 1];
  }

  // Upper bound: all others may have their turn first. Σ min(before + 1, length) over their lines, computed
  // from the nearer end.
  [[nodiscard]] Before most_before(std::size_t at, const Client& owner,
                                   typename Line::const_iterator place) const {
    const Line& line = owner.lines[at];
    const auto behind = static_cast<std::size_t>(std::distance(place, line.end())) - 1;
    const std::size_t before = line.size() - 1 - behind;
    const std::vector<std::size_t>& counts = at_least_[at];
    std::size_t all = 0;  // items of this client and of others
    if (before + 1 < counts.size() / 2) {
      all = std::accumulate(counts.begin(), counts.begin() + static_cast<std::ptrdiff_t>(before + 1), 0UL);
    } else {
      all = waiting_[at];
      for (std::size_t k = before + 1; k < counts.size(); ++k) all -= counts[k];
    }
    const double own_s =
        std::accumulate(place, line.end(), owner.work_s[at],
                        [](double left_s, const auto& entry) { return left_s - entry.second.run_s; });
    const std::size_t others = waiting_[at] - line.size();
    const double mean_s = others == 0 ? 0.0 : (work_s_[at] - owner.work_s[at]) / static_cast<double>(others);
    return {all - 1, std::max(0.0, own_s) + mean_s * static_cast<double>(all - 1 - before)};
  }

  // Removes the item and its place in the line.
  std::shared_ptr<Item> leave_line(Known& known) {
    const Ticket& ticket = known.ticket;
    const auto at = static_cast<std::size_t>(ticket.priority);
    Client& client = *known.client;
    Line& line = client.lines[at];
    const auto place = line.find(known.key);
    std::shared_ptr<Item> item = std::move(place->second.item);
    if (--at_least_[at][line.size() - 1] == 0 && line.size() == at_least_[at].size())
      at_least_[at].pop_back();
    line.erase(place);
    client.work_s[at] = line.empty() ? 0.0 : client.work_s[at] - ticket.expected_run_s;
    if (line.empty()) turns_[at].erase(client.turns[at]);
    if (ticket.deadline != Time::max()) deadlines_.erase({latest_begin(ticket), item.get()});
    work_s_[at] = --waiting_[at] == 0 ? 0.0 : work_s_[at] - ticket.expected_run_s;
    if (ticket.takes_place()) --client.queued;
    if (ticket.may_preempt) --preempting_[at];
    return item;
  }

  std::shared_ptr<Item> take_out(typename Tickets::iterator found) {
    std::shared_ptr<Item> item = leave_line(found->second);
    forget(found);
    return item;
  }

  void forget(typename Tickets::iterator found) {
    const Ticket& ticket = found->second.ticket;
    const auto client = clients_.find(ticket.client);
    client->second.bytes -= ticket.bytes;
    bytes_ -= ticket.bytes;
    if (ticket.takes_place()) --unreserved_;
    forget_if_idle(client);
    tickets_.erase(found);
  }

  void count_held(Client& client, std::int64_t bytes) {
    client.held += bytes;
    client.bytes += bytes;
    held_ += bytes;
    bytes_ += bytes;
  }

  void forget_if_idle(typename std::map<std::string, Client>::iterator found) {
    const Client& client = found->second;
    const bool empty =
        std::all_of(client.lines.begin(), client.lines.end(), [](const Line& line) { return line.empty(); });
    if (empty && client.running == 0 && client.held == 0 && client.places == 0) clients_.erase(found);
  }

  inline static const Client kNobody = {};

  const QueueLimits limits_;
  std::map<std::string, Client> clients_;  // clients with waiting or running items
  std::array<Turns, kPriorities> turns_;   // clients with waiting items, the next one first
  Tickets tickets_;
  std::set<std::pair<Time, const Item*>> deadlines_;            // latest time to begin each waiting item
  std::array<std::vector<std::size_t>, kPriorities> at_least_;  // [k]: lines of more than k items
  Ahead waiting_ = {}, preempting_ = {};                        // preempting: those of them that may preempt
  std::array<double, kPriorities> work_s_ = {};
  StarvationLimit starvation_limit_;
  int running_ = 0, unreserved_ = 0;
  std::int64_t bytes_ = 0, held_ = 0, next_number_ = 0;  // bytes: including held bytes
};

}  // namespace marble::server
