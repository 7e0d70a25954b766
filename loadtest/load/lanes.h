// Holds all lanes of a run: one per entry for calls, or one stream per client or connection.
#pragma once

#include <memory>
#include <vector>

#include "load_target.h"
#include "plan.h"
#include "work.h"
#include "workload.h"

namespace marble::load {

class Lanes {
 public:
  /// Opens every stream, and waits until the sessions are ready. All arguments outlive the lanes.
  [[nodiscard]] static Expected<Lanes> open(const Target& target, const std::vector<LoadedEntry>& entries,
                                            const Plan& plan, const Done& done);

  void send(const Work& work) const {
    const auto& lanes = of_entry_[work.entry];
    lanes[work.client % lanes.size()]->send(work);
  }
  void cancel() const {
    for (const auto& lanes : of_entry_)
      for (const auto& lane : lanes) lane->cancel();
  }

 private:
  std::vector<std::vector<std::unique_ptr<Lane>>> of_entry_;
};

}  // namespace marble::load
