// An array that is being received by a server with a shared store.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "fleet/fleet_store.h"
#include "submissions/array_draft.h"

namespace marble::server {

/// Its elements are in the store, where no server sees them until it is sealed. The quotas of all servers
/// apply to it from the start.
class FleetDraft final : public ArrayDraft {
 public:
  /// Error fields are paths from the set-up's root. Errors: those of admission; unavailable.
  [[nodiscard]] static Expected<std::shared_ptr<ArrayDraft>> make(const ServiceParts& parts,
                                                                  FleetStore& store, const Caller& caller,
                                                                  v1::ArraySetup setup);
  ~FleetDraft() override;

 private:
  FleetDraft(const ServiceParts& parts, FleetStore& store, const Caller& caller,
             std::shared_ptr<const ArraySetup> setup, const std::string& setup_bytes);
  [[nodiscard]] bool is_repeated() const override { return is_repeated_; }
  [[nodiscard]] Expected<void> add_bytes(std::int64_t /*bytes*/) override { return {}; }
  void keep(StoredElement element, CompletionCallback settled) override;
  void seal_all(const Sealed& sealed) override;
  void open();
  // Of a write that was made.
  void look_at_refusal();
  [[nodiscard]] std::shared_ptr<FleetDraft> self() {
    return std::static_pointer_cast<FleetDraft>(shared_from_this());
  }

  FleetStore& store_;
  const std::shared_ptr<FleetJob> job_;
  std::atomic<bool> is_repeated_ = false;
  bool is_sealed_ = false;
};

/// Returns the error of a client whose name the store would not take.
[[nodiscard]] Expected<void> check_name(const std::string& client);

}  // namespace marble::server
