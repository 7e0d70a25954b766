#include "metrics/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <unordered_map>

#include "base/refusal.h"
#include "metrics/metric_registry.h"
#include "mutex.h"

namespace marble::server {
namespace {

constexpr std::size_t kStatuses = static_cast<std::size_t>(Status::numerical_failure) + 1;

std::size_t index_of(Priority priority) { return static_cast<std::size_t>(priority); }
std::size_t index_of(Status status) { return static_cast<std::size_t>(status); }

// A name in a certificate may contain any bytes; the text format requires UTF-8.
std::string printable(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c >= 0x7f; }, '?');
  return name;
}

}  // namespace

// Counts what each client has solved, for a bounded number of clients. Thread-safe.
class ClientMetrics {
 public:
  /// The first `most` clients have series of their own, later ones share "other"; with 0, all clients do.
  ClientMetrics(MetricRegistry& registry, int most) : registry_(registry), most_(most) {}

  void solved(const std::string& client, double solve_s) ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Series {
    prometheus::Counter* solves = nullptr;
    prometheus::Counter* solve_s = nullptr;
  };
  [[nodiscard]] Series series_of(const std::string& client) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Series make(const std::string& label);

  MetricRegistry& registry_;
  const int most_;
  Mutex mutex_;
  std::unordered_map<std::string, Series> known_ ABSL_GUARDED_BY(mutex_);
  Series other_ ABSL_GUARDED_BY(mutex_);
};

void ClientMetrics::solved(const std::string& client, double solve_s) {
  if (most_ == 0) return;
  const Series series = series_of(client);
  series.solves->Increment();
  series.solve_s->Increment(solve_s);
}

ClientMetrics::Series ClientMetrics::series_of(const std::string& client) {
  const MutexLock lock(mutex_);
  if (const auto known = known_.find(client); known != known_.end()) return known->second;
  if (known_.size() < static_cast<std::size_t>(most_))
    return known_.emplace(client, make(printable(client))).first->second;
  if (other_.solves == nullptr) other_ = make("other");
  return other_;
}

ClientMetrics::Series ClientMetrics::make(const std::string& label) {
  return {&registry_.counter(Metric::client_solves, {label}),
          &registry_.counter(Metric::client_solve_seconds, {label})};
}

struct Metrics::Counted {
  using Counter = prometheus::Counter;
  using Histogram = prometheus::Histogram;

  Counted(MetricRegistry& registry, int most_clients)
      : setup_s(registry.histogram(Metric::setup_seconds)),
        iterations(registry.histogram(Metric::solve_iterations)),
        factorizations(registry.histogram(Metric::solve_factorizations)),
        tree_gap(registry.histogram(Metric::tree_gap)),
        tree_nodes(registry.counter(Metric::tree_nodes)),
        superseded(registry.counter(Metric::session_updates_superseded)),
        restarts(registry.counter(Metric::session_restarts)),
        rows_sent(registry.counter(Metric::progress_rows_sent)),
        rows_skipped(registry.counter(Metric::progress_rows_skipped)),
        clients(registry, most_clients) {
    for (std::size_t at = 0; at < kPriorities; ++at) {
      const std::string priority = kPriorityNames[at];
      for (std::size_t status = 0; status < kStatuses; ++status)
        solves[status][at] =
            &registry.counter(Metric::solves, {to_string(static_cast<Status>(status)), priority});
      solve_s[at] = &registry.histogram(Metric::solve_seconds, {priority});
      queue_s[at] = &registry.histogram(Metric::queue_wait_seconds, {priority});
    }
    for (const bool proved : {false, true})
      trees[proved ? 1 : 0] = &registry.counter(Metric::trees, {proved ? "true" : "false"});
    for (std::size_t reason = 0; reason < kRefusalReasons; ++reason)
      updates_refused[reason] = &registry.counter(Metric::session_updates_refused, {refusal_name(reason)});
  }

  std::array<std::array<Counter*, kPriorities>, kStatuses> solves = {};
  std::array<Histogram*, kPriorities> solve_s = {}, queue_s = {};
  std::array<Counter*, kRefusalReasons> updates_refused = {};
  std::array<Counter*, 2> trees = {};  // not proved, proved
  Histogram &setup_s, &iterations, &factorizations, &tree_gap;
  Counter &tree_nodes, &superseded, &restarts, &rows_sent, &rows_skipped;
  ClientMetrics clients;
};

Metrics::Metrics(bool on, int clients)
    : counted_(on ? std::make_unique<Counted>(registry_, clients) : nullptr) {}

Metrics::~Metrics() = default;

void Metrics::count_tree(const Solution& solution) {
  if (solution.nodes == 0) return;
  counted_->trees[solution.proved ? 1 : 0]->Increment();
  counted_->tree_nodes.Increment(static_cast<double>(solution.nodes));
  if (std::isfinite(solution.gap))
    counted_->tree_gap.Observe(solution.gap);  // infinity would stay in the sum
}

void Metrics::job_ended(const EndedJob& job) {
  if (!on()) return;
  const std::size_t priority = index_of(job.priority);
  counted_->queue_s[priority]->Observe(job.queue_s);
  if (job.setup_s) counted_->setup_s.Observe(*job.setup_s);
  if (job.solution == nullptr) return;
  const Solution& solution = *job.solution;
  counted_->solves[index_of(solution.status)][priority]->Increment();
  counted_->solve_s[priority]->Observe(solution.times.solve_s);
  counted_->iterations.Observe(solution.iterations);
  counted_->factorizations.Observe(solution.factorizations);
  count_tree(solution);
  counted_->clients.solved(job.client, solution.times.solve_s);
}

void Metrics::update_superseded() {
  if (on()) counted_->superseded.Increment();
}

void Metrics::session_restarted() {
  if (on()) counted_->restarts.Increment();
}

void Metrics::update_refused(const Error& error) {
  if (on()) counted_->updates_refused[refusal_reason(error)]->Increment();
}

void Metrics::progress_sent(std::size_t rows, std::int64_t skipped) {
  if (!on()) return;
  counted_->rows_sent.Increment(static_cast<double>(rows));
  if (skipped > 0) counted_->rows_skipped.Increment(static_cast<double>(skipped));
}

}  // namespace marble::server
