// Submitted jobs in a store that several servers share: each takes those that it has workers for, and serves
// clients of all.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "fleet/fleet_arrays.h"
#include "fleet/fleet_mirror.h"
#include "fleet/fleet_store.h"
#include "store/submissions.h"

namespace marble::server {

class FleetSubmissions final : public Submissions, FleetTaker, FleetOwner {
 public:
  /// Called before any other method. Errors: failed_precondition (tables of another version). A store that
  /// cannot be reached is no error.
  [[nodiscard]] static Expected<std::unique_ptr<Submissions>> begin(const ServiceParts& parts);
  ~FleetSubmissions() override;
  FleetSubmissions(const FleetSubmissions&) = delete;
  FleetSubmissions& operator=(const FleetSubmissions&) = delete;

  [[nodiscard]] Expected<OnFinished> submit(const Caller& caller, std::shared_ptr<v1::SolveRequest> request,
                                            v1::SubmitResponse* response) override;
  [[nodiscard]] Expected<OnFinished> cancel(const Identity& caller, const std::string& id,
                                            v1::CancelJobResponse* response) override;
  [[nodiscard]] Expected<OnFinished> remove(const Identity& caller, const std::string& id) override;
  void look(const std::string& id, CompletionCallback then) override { mirror_.look(id, std::move(then)); }
  void fetch_pair(const std::string& id, bool /*finished*/,
                  std::function<void(Expected<AskedAndAnswered>)> then) override {
    mirror_.fetch_pair(id, std::move(then));
  }
  [[nodiscard]] Expected<std::shared_ptr<ArrayDraft>> begin_array(const Caller& caller,
                                                                  v1::ArraySetup setup) override;
  void find_array(const std::string& id, std::function<void(Expected<FoundArray>)> then) override {
    mirror_.find_array(id, std::move(then));
  }
  [[nodiscard]] bool is_array(const std::string& id) const override;
  [[nodiscard]] Expected<void> health() const override { return store_.health(); }
  [[nodiscard]] std::optional<StoreUsage> usage() const override { return store_.usage(); }
  [[nodiscard]] bool is_settled() const override { return store_.is_settled() && mirror_.is_settled(); }
  /// Called after the drain.
  void close() override;

 private:
  // A job that this server has taken and that has no result in the store yet.
  struct Held {
    std::int64_t number = 0;
    std::string token;
    std::shared_ptr<JobRecord> record;
    std::int64_t begin = 0, cursor = 0;  // row numbers: before its first; last sent
    std::int64_t changes = 0;
    bool is_lost = false;      // another server has it
    bool is_suspect = false;   // a server died while running it
    FleetArray elements = {};  // of an array
  };
  class Keeper;
  class Waiter;

  explicit FleetSubmissions(const ServiceParts& parts);
  // FleetTaker
  [[nodiscard]] FleetTaker::Room room() override ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Quota quota_of(const std::string& client) override;
  void took(std::vector<TakenJob> jobs) override ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> held() override ABSL_LOCKS_EXCLUDED(mutex_);
  void lost(const std::vector<std::string>& ids) override ABSL_LOCKS_EXCLUDED(mutex_);
  void cancelled(const std::string& id) override ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::vector<LiveJob> live() override ABSL_LOCKS_EXCLUDED(mutex_);
  // FleetOwner
  [[nodiscard]] bool has(const std::string& id) override ABSL_LOCKS_EXCLUDED(mutex_);
  bool unless_here(const std::string& id, const std::function<void()>& then) override
      ABSL_LOCKS_EXCLUDED(mutex_);
  void jobs_wait() override;

  void take_in_array(const TakenJob& taken, const std::shared_ptr<JobRecord>& record)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void left(const std::string& id, const std::string& token) ABSL_LOCKS_EXCLUDED(mutex_);
  void take_in(TakenJob taken, const std::shared_ptr<JobRecord>& record) ABSL_LOCKS_EXCLUDED(mutex_);
  void end(const std::shared_ptr<JobRecord>& record, const std::string& token, double age_s,
           const Error& error) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::shared_ptr<JobRecord> hold(const TakenJob& taken, bool is_suspect)
      ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::shared_ptr<JobRecord> hold_locked(const TakenJob& taken, bool is_suspect)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void ended(JobRecord& record, const std::string& token, Outcome outcome) ABSL_LOCKS_EXCLUDED(mutex_);
  void erase(const std::string& id, const std::string& token) ABSL_LOCKS_EXCLUDED(mutex_);

  const ServiceParts& parts_;
  const std::string server_;
  const std::shared_ptr<Waiter> room_;
  OneSuspect one_suspect_;
  Mutex mutex_;  // taken before the board's and the records' locks
  std::map<std::string, Held> held_ ABSL_GUARDED_BY(mutex_);
  FleetMirror mirror_;
  FleetStore store_;
};

}  // namespace marble::server
