// An array that is being received by a server with a store of its own, or without one.
#pragma once

#include <memory>
#include <string>

#include "submissions/array_draft.h"

namespace marble::server {

class Arrays;

class LocalArrayDraft final : public ArrayDraft {
 public:
  /// `place` is null if an array with this request id exists.
  [[nodiscard]] static std::shared_ptr<ArrayDraft> make(Arrays& arrays, const Caller& caller,
                                                        std::shared_ptr<const ArraySetup> setup,
                                                        std::shared_ptr<Scheduler::Place> place,
                                                        const std::string& setup_bytes);
  ~LocalArrayDraft() override;

  void drop() override { place_ = nullptr; }

 private:
  LocalArrayDraft(Arrays& arrays, const Caller& caller, std::shared_ptr<const ArraySetup> setup,
                  std::shared_ptr<Scheduler::Place> place, const std::string& setup_bytes);
  [[nodiscard]] bool is_repeated() const override { return is_repeated_; }
  [[nodiscard]] Expected<void> add_bytes(std::int64_t bytes) override { return place_->add_bytes(bytes); }
  void keep(StoredElement element, CompletionCallback settled) override;
  void seal_all(const Sealed& sealed) override;
  void seal_new(const Sealed& sealed);
  [[nodiscard]] std::shared_ptr<LocalArrayDraft> self() {
    return std::static_pointer_cast<LocalArrayDraft>(shared_from_this());
  }

  Arrays& arrays_;
  std::shared_ptr<Scheduler::Place> place_;
  const bool is_repeated_;
  bool is_sealed_ = false;
};

}  // namespace marble::server
