// Submitted jobs that are this server's own: in memory, and on disk where there is a store.
#pragma once

#include "service/service_parts.h"
#include "store/job_store.h"
#include "store/submissions.h"
#include "submissions/recovery.h"

namespace marble::server {

class LocalSubmissions final : public Submissions {
 public:
  /// Before anybody calls; takes up what the store holds. `store` may be null. Errors: unavailable (it cannot
  /// be read).
  [[nodiscard]] static Expected<std::unique_ptr<Submissions>> begin(const ServiceParts& parts,
                                                                    JobStore* store);

  [[nodiscard]] Expected<Afterwards> submit(const Caller& caller, std::shared_ptr<v1::SolveRequest> request,
                                            v1::SubmitResponse* response) override;
  [[nodiscard]] Expected<Afterwards> cancel(const Identity& caller, const std::string& id,
                                            v1::CancelJobResponse* response) override;
  [[nodiscard]] Expected<Afterwards> remove(const Identity& caller, const std::string& id) override;
  void look(const std::string& /*id*/, Settled then) override { then({}); }
  [[nodiscard]] Expected<void> health() const override;
  [[nodiscard]] std::optional<StoreUsage> usage() const override;
  void close() override {
    if (store_ != nullptr) store_->close();
  }
  [[nodiscard]] bool is_settled() const override { return store_ == nullptr || store_->is_settled(); }

 private:
  LocalSubmissions(const ServiceParts& parts, JobStore* store) : parts_(parts), store_(store) {}
  // What waits until all that the store was asked for is made; nothing where there is none.
  [[nodiscard]] Afterwards when_settled() const;

  const ServiceParts& parts_;
  JobStore* const store_;
  std::shared_ptr<Recovery> recovery_;
};

}  // namespace marble::server
