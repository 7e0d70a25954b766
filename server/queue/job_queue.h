// The queue as a pure data structure: who is next, who must be refused. No threads, no clock.
//
// A higher priority goes first; one that was passed over `passed_over` times in a row, or for
// `passed_over_time`, goes once in between. Within a priority clients take turns. Within a client the
// earliest deadline goes first, then who came first; a job without a deadline, or with a far one, counts as
// due `patience` after it came, so that it does not starve.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "base/quota.h"
#include "queue/passed_over.h"

namespace marble::server {

struct QueueLimits {
  int workers = 1;         ///< a free worker counts as room, so that jobs = 0 means "no waiting"
  int jobs = 0;            ///< that wait; one place in 16 is for realtime jobs alone
  std::int64_t bytes = 0;  ///< of requests that wait, here or in their sessions, or run
  int passed_over = 32;    ///< how often in a row a priority with something to do may be passed over
  std::chrono::steady_clock::duration passed_over_time = std::chrono::seconds(1);  ///< for how long
  std::chrono::steady_clock::duration patience = std::chrono::seconds(10);

  /// How many may wait when a job of this priority comes. Others' jobs never fill the queue, so that a
  /// planner is not refused because somebody floods the server.
  [[nodiscard]] int jobs_for(Priority priority) const {
    return priority == Priority::realtime ? jobs : jobs - jobs / 16;
  }
};

/// What the queue wants to know of an item.
struct Ticket {
  std::string client;
  Priority priority = Priority::interactive;
  std::chrono::steady_clock::time_point deadline = std::chrono::steady_clock::time_point::max();
  std::chrono::steady_clock::time_point arrival = {};
  std::chrono::steady_clock::duration least_run = {};  ///< it runs for no less than this
  std::int64_t bytes = 0;
  bool reserved = false;  ///< an update of a session: its place was given with the session
};

/// Why an item is not taken.
enum class QueueRefusal { none, jobs, bytes, client_jobs, client_bytes };

/// Items are waiting until pop(), then running until done(). Each is known by its address.
template <class Item>
class JobQueue {
 public:
  using Time = std::chrono::steady_clock::time_point;
  using Ahead = std::array<std::size_t, kPriorities>;

  explicit JobQueue(const QueueLimits& limits)
      : limits_(limits), passed_over_(limits.passed_over, limits.passed_over_time) {}

  /// Takes the item, or says why not; then the caller keeps it. The newest quota of a client counts.
  [[nodiscard]] QueueRefusal push(std::shared_ptr<Item> item, const Ticket& ticket, const Quota& quota) {
    const auto known = clients_.find(ticket.client);
    const Client& client = known == clients_.end() ? kNobody : known->second;
    if (!ticket.reserved) {
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
    if (!ticket.reserved) {
      ++unreserved_;
      ++owner.queued;
    }
    const auto at = static_cast<std::size_t>(ticket.priority);
    Line& line = owner.lines[at];
    if (line.empty()) turns_[at].push_back(ticket.client);
    const Key key{std::min(ticket.deadline, ticket.arrival + limits_.patience), next_number_++};
    tickets_.emplace(item.get(), Known{ticket, key, false});
    line.emplace(key, std::move(item));
    ++waiting_[at];
    return QueueRefusal::none;
  }

  /// Counts bytes that wait for their turn outside the queue, until they are released. Of all together they
  /// are at most half of what may wait, of one client a quarter, so that whoever does not come to their turn
  /// leaves room for the others. False if there is no room.
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

  /// The next item that may run, which then does; null if there is none. Without a time only turns count.
  [[nodiscard]] std::shared_ptr<Item> pop(Time now = Time()) {
    const std::size_t at = choose_priority(now);
    if (at == kPriorities) return nullptr;
    const auto turn = find_turn(at);
    Client& client = clients_.at(*turn);
    Line& line = client.lines[at];
    std::shared_ptr<Item> item = std::move(line.begin()->second);
    line.erase(line.begin());
    turns_[at].splice(turns_[at].end(), turns_[at], turn);
    if (line.empty()) turns_[at].pop_back();
    Known& known = tickets_.at(item.get());
    known.running = true;
    leave_line(known.ticket, client);
    ++client.running;
    ++running_;
    return item;
  }

  /// A popped item has ended.
  void done(const Item* item) {
    const auto found = tickets_.find(item);
    Client& client = clients_.at(found->second.ticket.client);
    --client.running;
    --running_;
    forget(found);
  }

  /// True if the item was waiting; it is no more.
  bool remove(const Item* item) {
    const auto found = tickets_.find(item);
    if (found == tickets_.end() || found->second.running) return false;
    static_cast<void>(take_out(found));
    return true;
  }

  /// Waiting items that cannot meet their deadline any more, all of them at the end of time; they are out of
  /// the queue.
  [[nodiscard]] std::vector<std::shared_ptr<Item>> expire(Time now) {
    std::vector<std::shared_ptr<Item>> late;
    for (auto known = tickets_.begin(); known != tickets_.end();) {
      const auto next = std::next(known);
      const Ticket& ticket = known->second.ticket;
      const bool hopeless =
          now == Time::max() || (ticket.deadline != Time::max() && ticket.deadline - now <= ticket.least_run);
      if (!known->second.running && hopeless) late.push_back(take_out(known));
      known = next;
    }
    return late;
  }

  /// How many of each priority will be taken before this waiting item, if nothing comes or goes; nothing for
  /// others.
  [[nodiscard]] Ahead ahead_of(const Item* item) const {
    Ahead ahead = {};
    const auto found = tickets_.find(item);
    if (found == tickets_.end() || found->second.running) return ahead;
    const Ticket& ticket = found->second.ticket;
    const auto own = static_cast<std::size_t>(ticket.priority);
    for (std::size_t at = 0; at < own; ++at) ahead[at] = waiting_[at];
    const Line& line = clients_.at(ticket.client).lines[own];
    const auto before = static_cast<std::size_t>(std::distance(line.begin(), line.find(found->second.key)));
    std::size_t rounds = before + 1;  // of those whose turn is before this client's
    for (const std::string& name : turns_[own]) {
      if (name == ticket.client) {
        ahead[own] += before;
        rounds = before;
      } else {
        ahead[own] += std::min(rounds, clients_.at(name).lines[own].size());
      }
    }
    return ahead;
  }

  [[nodiscard]] bool is_waiting(const Item* item) const {
    const auto found = tickets_.find(item);
    return found != tickets_.end() && !found->second.running;
  }
  [[nodiscard]] std::size_t waiting() const { return std::accumulate(waiting_.begin(), waiting_.end(), 0UL); }
  [[nodiscard]] const Ahead& waiting_by_priority() const { return waiting_; }
  [[nodiscard]] int running() const { return running_; }
  [[nodiscard]] std::int64_t bytes() const { return bytes_; }
  [[nodiscard]] std::size_t clients() const { return clients_.size(); }  ///< with anything in it
  /// Whether a job of no size would be taken.
  [[nodiscard]] bool has_room(Priority priority) const {
    return unreserved_ < limits_.jobs_for(priority) + limits_.workers;
  }
  /// Whether pop() would give something.
  [[nodiscard]] bool ready() const {
    for (std::size_t at = 0; at < kPriorities; ++at) {
      if (find_turn(at) != turns_[at].end()) return true;
    }
    return false;
  }

 private:
  using Key = std::pair<Time, std::int64_t>;  // when it is due, then the order of arrival
  using Line = std::map<Key, std::shared_ptr<Item>>;
  struct Client {
    Quota quota;
    int queued = 0, running = 0;       // queued: without reserved ones
    std::int64_t bytes = 0, held = 0;  // bytes: with those held
    std::array<Line, kPriorities> lines;
  };
  struct Known {
    Ticket ticket;
    Key key;
    bool running;
  };
  using Tickets = std::map<const Item*, Known>;
  [[nodiscard]] auto find_turn(std::size_t at) const {
    return std::find_if(turns_[at].begin(), turns_[at].end(), [this](const std::string& name) {
      const Client& client = clients_.at(name);
      return client.running < client.quota.running;
    });
  }

  // Counts who was passed over, too.
  [[nodiscard]] std::size_t choose_priority(Time now) {
    std::array<bool, kPriorities> able = {};
    for (std::size_t at = 0; at < kPriorities; ++at) able[at] = find_turn(at) != turns_[at].end();
    return passed_over_.choose(able, now);
  }

  void leave_line(const Ticket& ticket, Client& client) {
    --waiting_[static_cast<std::size_t>(ticket.priority)];
    if (!ticket.reserved) --client.queued;
  }

  std::shared_ptr<Item> take_out(typename Tickets::iterator found) {
    const Ticket& ticket = found->second.ticket;
    const auto at = static_cast<std::size_t>(ticket.priority);
    Client& client = clients_.at(ticket.client);
    Line& line = client.lines[at];
    const auto place = line.find(found->second.key);
    std::shared_ptr<Item> item = std::move(place->second);
    line.erase(place);
    if (line.empty()) turns_[at].remove(ticket.client);
    leave_line(ticket, client);
    forget(found);
    return item;
  }

  void forget(typename Tickets::iterator found) {
    const Ticket& ticket = found->second.ticket;
    const auto client = clients_.find(ticket.client);
    client->second.bytes -= ticket.bytes;
    bytes_ -= ticket.bytes;
    if (!ticket.reserved) --unreserved_;
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
    if (empty && client.running == 0 && client.held == 0) clients_.erase(found);
  }

  inline static const Client kNobody = {};

  const QueueLimits limits_;
  std::map<std::string, Client> clients_;                  // those with something waiting or running
  std::array<std::list<std::string>, kPriorities> turns_;  // clients with something waiting, next one first
  Tickets tickets_;
  Ahead waiting_ = {};
  PassedOver passed_over_;
  int running_ = 0, unreserved_ = 0;
  std::int64_t bytes_ = 0, held_ = 0, next_number_ = 0;  // bytes: with those held
};

}  // namespace marble::server
