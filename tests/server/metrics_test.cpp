// The metrics themselves: what they are called, what they count, and that they stay bounded.
#include "metrics/metrics.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <regex>
#include <set>

#include "base/process.h"
#include "metrics/rpc_metrics.h"
#include "service/scrape.h"
#include "service/service_parts.h"
#include "submissions/local_submissions.h"

namespace marble::server {
namespace {

Job job_of(const std::string& client, Priority priority = Priority::interactive) {
  Job job;
  job.ticket.client = client;
  job.ticket.priority = priority;
  return job;
}

Outcome solved(double solve_s = 0.25, int iterations = 7) {
  Solution solution;
  solution.status = Status::solved;
  solution.iterations = iterations;
  solution.times.setup_s = 0.125;
  solution.times.solve_s = solve_s;
  Outcome outcome;
  outcome.solution = std::move(solution);
  outcome.queue_s = 0.5;
  return outcome;
}

class MetricsTest : public ::testing::Test {
 protected:
  MetricsTest() { parts_.submissions = submissions_.get(); }
  [[nodiscard]] std::string text() const { return scrape(parts_); }
  /// The value in the line that begins with `series`; NaN if there is none.
  [[nodiscard]] double value_of(const std::string& series) const {
    std::istringstream lines(text());
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind(series + " ", 0) == 0) return std::stod(line.substr(series.size() + 1));
    }
    return std::nan("");
  }
  [[nodiscard]] std::size_t lines_with(const std::string& begin) const {
    std::istringstream lines(text());
    std::size_t count = 0;
    for (std::string line; std::getline(lines, line);) count += line.rfind(begin, 0) == 0 ? 1 : 0;
    return count;
  }

  Config config_;
  Access access_{config_};
  Log log_{"text", "off", 1 << 20};
  Metrics metrics_{true, 50};
  Timer pulse_;
  JobBoard board_{{}};
  FeedLimit feeds_{3};
  ResultStore results_{{}};
  Scheduler scheduler_{{.workers = 2, .jobs = 5, .bytes = 1000}, board_, log_, metrics_};
  SessionTable sessions_{{}};
  ConnectionTable connections_{{}, log_};
  LiveCalls calls_;
  ServiceParts parts_{config_, access_,  log_,       metrics_,  pulse_,       board_,
                      feeds_,  results_, scheduler_, sessions_, connections_, calls_};
  const std::unique_ptr<Submissions> submissions_ = LocalSubmissions::begin(parts_, nullptr).value();
};

TEST_F(MetricsTest, EveryMetricOfTheTableIsReportedWithHelpAndType) {
  const auto interceptors = rpc_interceptors(metrics_.registry());
  metrics_.job_ended(counted_of(job_of("planner"), solved()));
  const std::string reported = text();
  for (const MetricInfo& metric : metric_table()) {
    EXPECT_NE(reported.find("# HELP " + metric.name + " "), std::string::npos) << metric.name;
    const std::string type = "# TYPE " + metric.name + " " + type_of(metric.kind) + "\n";
    EXPECT_NE(reported.find(type), std::string::npos) << type;
  }
}

TEST_F(MetricsTest, NothingIsReportedThatIsNotInTheTable) {
  std::set<std::string> known;
  for (const MetricInfo& metric : metric_table()) known.insert(metric.name);
  EXPECT_EQ(known.size(), metric_table().size()) << "each has a name of its own";
  std::istringstream lines(text());
  for (std::string hash, kind, name, rest; lines >> hash; std::getline(lines, rest)) {
    if (hash != "#" || !(lines >> kind >> name)) continue;
    EXPECT_EQ(known.count(name), 1U) << name;
  }
}

TEST(MetricTable, FollowsTheConventionsOfPrometheus) {
  const std::regex name("(marble|process)_[a-z]+(_[a-z]+)*"), label("[a-z]+");
  for (const MetricInfo& metric : metric_table()) {
    EXPECT_TRUE(std::regex_match(metric.name, name)) << metric.name;
    EXPECT_EQ(metric.name.ends_with("_total"), type_of(metric.kind) == std::string("counter")) << metric.name;
    EXPECT_TRUE(metric.kind != MetricKind::seconds || metric.name.ends_with("_seconds")) << metric.name;
    EXPECT_TRUE(metric.help.ends_with(".")) << metric.name;
    for (const std::string& each : metric.labels) EXPECT_TRUE(std::regex_match(each, label)) << each;
    for (const char* unit : {"_ms", "_us", "_s_", "minutes", "kib", "mib"})
      EXPECT_EQ(metric.name.find(unit), std::string::npos) << metric.name << ": base units";
  }
}

TEST(MetricTable, BucketsAscendOverTheRangeThatMatters) {
  for (const auto& [kind, least, most] :
       {std::tuple{MetricKind::seconds, 5e-5, 100.0}, std::tuple{MetricKind::counts, 1.0, 1e5}}) {
    const std::vector<double> buckets = buckets_of(kind);
    EXPECT_EQ(buckets.front(), least);
    EXPECT_EQ(buckets.back(), most);
    for (std::size_t i = 1; i < buckets.size(); ++i) {
      EXPECT_GT(buckets[i], buckets[i - 1]);
      EXPECT_LE(buckets[i], 2.6 * buckets[i - 1]) << "no gap";
    }
  }
}

TEST_F(MetricsTest, CountASolveOnceEverywhere) {
  metrics_.job_ended(counted_of(job_of("planner", Priority::realtime), solved(0.25, 7)));
  EXPECT_EQ(value_of(R"(marble_solves_total{priority="realtime",status="solved"})"), 1);
  EXPECT_EQ(value_of(R"(marble_solve_seconds_sum{priority="realtime"})"), 0.25);
  EXPECT_EQ(value_of("marble_solve_iterations_sum"), 7);
  EXPECT_EQ(value_of("marble_setup_seconds_sum"), 0.125);
  EXPECT_EQ(value_of(R"(marble_queue_wait_seconds_sum{priority="realtime"})"), 0.5);
  EXPECT_EQ(value_of(R"(marble_client_solves_total{client="planner"})"), 1);
  EXPECT_EQ(value_of(R"(marble_client_solve_seconds_total{client="planner"})"), 0.25);
}

TEST_F(MetricsTest, CountTreesNodesAndGaps) {
  const auto ended = [this](std::int64_t nodes, bool proved, double gap) {
    Outcome outcome = solved();
    outcome.solution->nodes = nodes;
    outcome.solution->proved = proved;
    outcome.solution->gap = gap;
    metrics_.job_ended(counted_of(job_of("planner"), outcome));
  };
  ended(0, true, HUGE_VAL);  // without a tree, proved by a certificate
  EXPECT_EQ(value_of(R"(marble_trees_total{proved="true"})"), 0);
  ended(12, true, 5e-7);
  ended(30, false, 0.25);
  ended(8, false, HUGE_VAL);  // no point, or no bound
  EXPECT_EQ(value_of(R"(marble_trees_total{proved="true"})"), 1);
  EXPECT_EQ(value_of(R"(marble_trees_total{proved="false"})"), 2);
  EXPECT_EQ(value_of("marble_tree_nodes_total"), 50);
  EXPECT_EQ(value_of(R"(marble_tree_gap_ratio_bucket{le="1e-06"})"), 1);
  EXPECT_EQ(value_of("marble_tree_gap_ratio_count"), 2);
  EXPECT_NEAR(value_of("marble_tree_gap_ratio_sum"), 0.2500005, 1e-12);
}

TEST_F(MetricsTest, ASetUpOfASessionIsNoSolveAndAnUpdateIsOne) {
  Job job = job_of("planner", Priority::realtime);
  job.ticket.reserved = true;
  job.is_setup = true;
  metrics_.job_ended(counted_of(job, solved()));
  EXPECT_EQ(value_of(R"(marble_solves_total{priority="realtime",status="solved"})"), 0);
  EXPECT_EQ(value_of("marble_setup_seconds_count"), 1);
  job.is_setup = false;
  metrics_.job_ended(counted_of(job, solved()));
  EXPECT_EQ(value_of(R"(marble_solves_total{priority="realtime",status="solved"})"), 1);
  EXPECT_EQ(value_of("marble_setup_seconds_count"), 1) << "it was set up once";
}

TEST_F(MetricsTest, AJobWithoutAnAnswerIsNoSolve) {
  Outcome gone = solved();
  gone.solution = unexpected(Error{ErrorCode::cancelled, "", -1, "", "given up"});
  metrics_.job_ended(counted_of(job_of("planner"), gone));
  EXPECT_EQ(value_of(R"(marble_queue_wait_seconds_count{priority="interactive"})"), 1);
  EXPECT_EQ(value_of(R"(marble_solve_seconds_count{priority="interactive"})"), 0);
  EXPECT_EQ(lines_with("marble_client_solves_total"), 0U);
}

TEST_F(MetricsTest, TenThousandClientsTakeNoMoreSeriesThanAreAllowed) {
  for (int i = 0; i < 10'000; ++i)
    metrics_.job_ended(counted_of(job_of("client " + std::to_string(i)), solved()));
  EXPECT_EQ(lines_with("marble_client_solves_total{"), 51U);
  EXPECT_EQ(value_of(R"(marble_client_solves_total{client="other"})"), 9950);
  EXPECT_EQ(value_of(R"(marble_client_solves_total{client="client 49"})"), 1);
}

TEST(Metrics, WithoutClientsNoneHasASeries) {
  Metrics metrics(true, 0);
  metrics.job_ended(counted_of(job_of("planner"), solved()));
  for (const auto& family : metrics.registry().collect())
    EXPECT_EQ(family.name.find("client"), std::string::npos) << family.name;
}

TEST_F(MetricsTest, ANameThatIsNoTextCannotBreakTheFormat) {
  metrics_.job_ended(counted_of(job_of("a\"b\\c\nd\xff"), solved()));
  EXPECT_EQ(value_of(R"(marble_client_solves_total{client="a\"b\\c?d?"})"), 1);
}

TEST(Metrics, OffCountsNothing) {
  Metrics metrics(false, 50);
  metrics.job_ended(counted_of(job_of("planner"), solved()));
  metrics.progress_sent(3, 1);
  metrics.update_superseded();
  EXPECT_TRUE(metrics.registry().collect().empty());
}

TEST_F(MetricsTest, RefusalsAreTheSchedulersOwnByReason) {
  scheduler_.count_refused({ErrorCode::resource_exhausted, "queue_jobs", -1, "", "full"});
  scheduler_.count_refused({ErrorCode::resource_exhausted, "something new", -1, "", "full"});
  scheduler_.count_refused({ErrorCode::invalid_argument, "problem.g", 3, "nan", "must be finite"});
  EXPECT_EQ(value_of(R"(marble_jobs_refused_total{reason="queue_jobs"})"), 1);
  EXPECT_EQ(value_of(R"(marble_jobs_refused_total{reason="resource_exhausted"})"), 1);
  EXPECT_EQ(value_of(R"(marble_jobs_refused_total{reason="invalid_argument"})"), 1);
  EXPECT_EQ(lines_with("marble_jobs_refused_total{"), kRefusalReasons) << "from the first scrape on";
  EXPECT_EQ(scheduler_.counters().refused, 3);
}

TEST_F(MetricsTest, TheProcessIsDescribedAsItIs) {
  EXPECT_EQ(value_of("process_threads"), process_facts().threads);
  EXPECT_GE(process_facts().threads, 3) << "two workers and this one";
  const double before = process_facts().open_fds;
  const int one_more = dup(STDERR_FILENO);
  EXPECT_EQ(process_facts().open_fds, before + 1);
  close(one_more);
  const auto now_s = std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch());
  EXPECT_LE(value_of("process_start_time_seconds"), now_s.count() + 1.0);
  EXPECT_GT(value_of("process_start_time_seconds"), now_s.count() - 3600.0);
}

}  // namespace
}  // namespace marble::server
