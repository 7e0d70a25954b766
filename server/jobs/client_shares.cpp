// Which clients use the workers: the queue's current state, and the last minutes.
#include <algorithm>
#include <map>

#include "jobs/scheduler.h"

namespace marble::server {

ClientShares Scheduler::client_shares() const {
  constexpr std::size_t kMostNames = 4 * ClientShares::kMost;  // names that are examined: each may wait
  const auto add = [](ClientShare& to, int running, int queued, const ClientUse& use) {
    to.running += running;
    to.queued += queued;
    to.use.done += use.done;
    to.use.busy_s += use.busy_s;
  };
  ClientShares shares;
  std::map<std::string, ClientShare> known;
  {
    const MutexLock lock(mutex_);
    const Clock::time_point now = Clock::now();
    const ClientUses::Sum sum = client_uses_.sum(now);
    shares.seconds = ClientUses::seconds(now);
    shares.others.use = sum.others;
    for (const auto& [name, use] : sum.clients) known[name].use = use;
    for (const auto& job : running_) {
      const double busy_s = job->is_paused ? 0.0 : seconds(now - job->begun);
      known[job->ticket.client].use.busy_s += std::min(busy_s, shares.seconds);
    }
    queue_.each_client([&](const std::string& name, int waiting, int running) {
      if (waiting == 0 && running == 0) return;
      const bool named = known.size() < kMostNames || known.contains(name);
      add(named ? known[name] : shares.others, running, waiting, {});
    });
  }
  for (auto& [name, share] : known) {
    share.client = name;
    shares.clients.push_back(std::move(share));
  }
  std::stable_sort(shares.clients.begin(), shares.clients.end(),
                   [](const auto& a, const auto& b) { return a.use.busy_s > b.use.busy_s; });
  for (std::size_t at = ClientShares::kMost; at < shares.clients.size(); ++at)
    add(shares.others, shares.clients[at].running, shares.clients[at].queued, shares.clients[at].use);
  shares.clients.resize(std::min(shares.clients.size(), ClientShares::kMost));
  return shares;
}

}  // namespace marble::server
