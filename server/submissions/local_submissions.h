// Submitted jobs of this server alone: in memory, and on disk if there is a store.
#pragma once

#include "service/service_parts.h"
#include "store/job_store.h"
#include "store/submissions.h"
#include "submissions/arrays.h"
#include "submissions/recovery.h"

namespace marble::server {

class LocalSubmissions final : public Submissions {
 public:
  /// Called before any other method; recovers what the store contains. `store` may be null. Errors:
  /// unavailable (it cannot be read).
  [[nodiscard]] static Expected<std::unique_ptr<Submissions>> begin(const ServiceParts& parts,
                                                                    JobStore* store);
  /// Running jobs report their end to this object.
  ~LocalSubmissions() override { parts_.scheduler.drain(std::chrono::duration<double>(0.0)); }
  LocalSubmissions(const LocalSubmissions&) = delete;
  LocalSubmissions& operator=(const LocalSubmissions&) = delete;

  [[nodiscard]] Expected<OnFinished> submit(const Caller& caller, std::shared_ptr<v1::SolveRequest> request,
                                            v1::SubmitResponse* response) override;
  [[nodiscard]] Expected<OnFinished> cancel(const Identity& caller, const std::string& id,
                                            v1::CancelJobResponse* response) override;
  [[nodiscard]] Expected<OnFinished> remove(const Identity& caller, const std::string& id) override;
  void look(const std::string& /*id*/, CompletionCallback then) override { then({}); }
  void fetch_pair(const std::string& id, bool finished,
                  std::function<void(Expected<AskedAndAnswered>)> then) override;
  [[nodiscard]] Expected<std::shared_ptr<ArrayDraft>> begin_array(const Caller& caller,
                                                                  v1::ArraySetup setup) override {
    return arrays_->begin(caller, std::move(setup));
  }
  void find_array(const std::string& id, std::function<void(Expected<FoundArray>)> then) override;
  [[nodiscard]] bool is_array(const std::string& id) const override { return arrays_->find(id) != nullptr; }
  [[nodiscard]] Expected<void> health() const override;
  [[nodiscard]] std::optional<StoreUsage> usage() const override;
  void close() override {
    if (store_ != nullptr) store_->close();
  }
  [[nodiscard]] bool is_settled() const override { return store_ == nullptr || store_->is_settled(); }

 private:
  LocalSubmissions(const ServiceParts& parts, JobStore* store)
      : parts_(parts), store_(store), arrays_(Arrays::make(parts, store)) {}
  // Waits until everything requested of the store is done; empty if there is no store.
  [[nodiscard]] OnFinished when_settled() const;

  const ServiceParts& parts_;
  JobStore* const store_;
  const std::shared_ptr<Arrays> arrays_;
  std::shared_ptr<Recovery> recovery_;
};

}  // namespace marble::server
