#include "lanes.h"

#include "call_lane.h"
#include "stream_lane.h"

namespace marble::load {

Expected<Lanes> Lanes::open(const Target& target, const std::vector<LoadedEntry>& entries, const Plan& plan,
                            const Done& done) {
  Lanes result;
  result.of_entry_.resize(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    auto& lanes = result.of_entry_[i];
    if (entries[i].mode == Mode::unary || entries[i].mode == Mode::streamed) {
      lanes.push_back(std::make_unique<CallLane>(target, entries[i], done));
      continue;
    }
    const int streams = entries[i].mode == Mode::session ? plan.clients : target.connections();
    for (int client = 0; client < streams; ++client) {
      auto lane = std::make_unique<StreamLane>(target, entries[i], static_cast<std::size_t>(client), done);
      if (auto opened = lane->open(); !opened) return unexpected(opened.error());
      lanes.push_back(std::move(lane));
    }
  }
  return result;
}

}  // namespace marble::load
