#include <httplib.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "bidi.h"
#include "marble/convert.h"
#include "marble/solution.h"
#include "secure_service_test.h"
#include "support/child_process.h"
#include "support/loopback.h"

namespace marble::testing {

// A real Prometheus for one test, asked through its HTTP API.
class PrometheusProcess {
 public:
  /// Scrapes the server at `target` (HOST:PORT) twice a second, with the token, and evaluates the rules.
  PrometheusProcess(const std::string& target, const std::string& token, const std::string& rules)
      : address_("127.0.0.1:" + std::to_string(free_port())),
        process_({MARBLE_PROMETHEUS_BINARY, "--config.file=" + write_configuration(target, token, rules),
                  "--storage.tsdb.path=" + directory_.file("data"), "--web.listen-address=" + address_,
                  "--log.level=warn"},
                 directory_.file("log")) {
    const bool ready = eventually([&] {
      const auto answer = client().Get("/-/ready");
      return !process_.running() || (answer && answer->status == 200);
    });
    if (!ready || !process_.running())
      throw std::runtime_error("Prometheus did not start: " + process_.output());
  }

  /// The answer of /api/v1/PATH; its "status" says whether it is one.
  [[nodiscard]] nlohmann::json get(const std::string& path, const httplib::Params& parameters = {}) {
    const auto answer = client().Get("/api/v1/" + path, parameters, httplib::Headers{});
    return answer ? nlohmann::json::parse(answer->body) : nlohmann::json{{"status", "no answer"}};
  }
  [[nodiscard]] nlohmann::json query(const std::string& expression) {
    return get("query", {{"query", expression}});
  }
  /// The value of a query with one sample; NaN if it has none or several.
  [[nodiscard]] double value(const std::string& expression) {
    const nlohmann::json answer = query(expression);
    if (answer.at("status") != "success" || answer.at("data").at("result").size() != 1) return std::nan("");
    return std::stod(answer.at("data").at("result")[0].at("value")[1].get<std::string>());
  }

 private:
  [[nodiscard]] httplib::Client client() const { return httplib::Client("http://" + address_); }

  [[nodiscard]] std::string write_configuration(const std::string& target, const std::string& token,
                                                const std::string& rules) const {
    std::string path = directory_.file("prometheus.yml");
    std::ofstream(path)
        << "global: {scrape_interval: 500ms, scrape_timeout: 500ms, evaluation_interval: 500ms}\n"
        << "rule_files: [\"" << rules << "\"]\n"
        << "scrape_configs:\n- job_name: marble\n"
        << "  authorization: {credentials: \"" << token << "\"}\n"
        << "  static_configs: [{targets: [\"" << target << "\"]}]\n";
    return path;
  }

  TemporaryDirectory directory_;
  std::string address_;
  ChildProcess process_;
};

namespace {

// A real Prometheus scrapes a real server under load, and its sums are what the clients saw. The alerts and
// the dashboard of deploy/ ask for what there is.
const std::string kDeploy = MARBLE_DEPLOY_DIR;
constexpr int kUnary = 3, kStreams = 2, kUpdates = 4, kBatch = 5;

std::string name_of(grpc::StatusCode code) {
  static const std::map<grpc::StatusCode, std::string> names = {
      {grpc::StatusCode::OK, "OK"},
      {grpc::StatusCode::INVALID_ARGUMENT, "INVALID_ARGUMENT"},
      {grpc::StatusCode::RESOURCE_EXHAUSTED, "RESOURCE_EXHAUSTED"},
      {grpc::StatusCode::UNAUTHENTICATED, "UNAUTHENTICATED"},
      {grpc::StatusCode::PERMISSION_DENIED, "PERMISSION_DENIED"}};
  return names.at(code);
}

// What the clients of one server saw, as queries and what they should give.
class Seen {
 public:
  void called(const std::string& method, const grpc::Status& status) {
    ++sums_["sum(marble_rpcs_total{method=\"marble.v1." + method + "\",code=\"" +
            name_of(status.error_code()) + "\"})"];
  }
  void solved(const std::string& client, const v1::Solution& solution) {
    const std::string status = to_string(status_of(solution.status()));
    ++sums_["sum(marble_solves_total{status=\"" + status + "\"})"];
    ++sums_["sum(marble_solves_total)"];
    ++sums_["sum(marble_solve_seconds_count)"];
    ++sums_["marble_client_solves_total{client=\"" + client + "\"}"];
    sums_["marble_solve_iterations_sum"] += solution.iterations();
    sums_["marble_solve_factorizations_sum"] += solution.factorizations();
  }
  void add(const std::string& query, double value = 1.0) { sums_[query] += value; }
  [[nodiscard]] const std::map<std::string, double>& sums() const { return sums_; }

 private:
  std::map<std::string, double> sums_;
};

class Prometheus : public SecureServiceTest {
 protected:
  void start_scraped() {
    start({"--tokens", write("tokens", alice_.line + bob_.line + eye_.line), "--http", "127.0.0.1:0",
           "--workers", "1", "--queue-jobs", "0", "--state-dir", directory_.file("state")});
    prometheus_ = std::make_unique<PrometheusProcess>(server().http().substr(std::string("http://").size()),
                                                      eye_.secret, kDeploy + "/prometheus/alerts.yml");
    ASSERT_TRUE(eventually([&] { return prometheus_->value("up") == 1.0; }));
  }

  /// Some of everything, one after the other.
  void load() {
    for (int i = 0; i < kUnary; ++i) unary(example_request(), alice_);
    unary(long_request(3), bob_);
    for (int i = 0; i < kStreams; ++i) stream();
    session();
    batch();
    v1::SolveRequest wrong = example_request();
    wrong.mutable_options()->set_max_iterations(-1);
    unary(wrong, bob_);
    seen_.add("marble_jobs_refused_total{reason=\"invalid_argument\"}");
    refused_while_full();
    unary(example_request(), Token{"wrong", ""});
    seen_.add("marble_jobs_refused_total{reason=\"unauthenticated\"}");
    seen_.add("marble_access_refused_total{reason=\"unauthenticated\"}");
    unary(example_request(), eye_);
    seen_.add("marble_jobs_refused_total{reason=\"permission_denied\"}");
    seen_.add("marble_access_refused_total{reason=\"permission_denied\"}");
    seen_.add("sum(marble_rpcs_open)", 0.0);
    seen_.add("sum(marble_queue_jobs)", 0.0);
    seen_.add("marble_workers_busy", 0.0);
  }

  void unary(const v1::SolveRequest& request, const Token& token) {
    grpc::ClientContext context;
    authorize(context, token);
    v1::SolveResponse response;
    const grpc::Status status = solver().Solve(&context, request, &response);
    seen_.called("Solver/Solve", status);
    const bool read = status.error_code() != grpc::StatusCode::UNAUTHENTICATED;
    seen_.add(R"(marble_rpc_received_bytes_total{method="marble.v1.Solver/Solve"})",
              read ? static_cast<double>(request.ByteSizeLong()) : 0.0);
    if (!status.ok()) return;
    seen_.add(R"(marble_rpc_sent_bytes_total{method="marble.v1.Solver/Solve"})",
              static_cast<double>(response.ByteSizeLong()));
    seen_.add("marble_jobs_accepted_total");
    seen_.add("marble_jobs_answered_total");
    seen_.solved(client_of(token), response.solution());
  }

  void stream() {
    grpc::ClientContext context;
    authorize(context, bob_);
    v1::SolveStreamRequest request;
    *request.mutable_solve() = example_request();
    const auto reader = solver().SolveStream(&context, request);
    for (Event event; reader->Read(&event);) {
      seen_.add("marble_progress_rows_sent_total", event.progress().rows_size());
      if (event.has_result()) seen_.solved("bob", event.result().solution());
    }
    seen_.called("Solver/SolveStream", reader->Finish());
    seen_.add("marble_jobs_accepted_total");
    seen_.add("marble_jobs_answered_total");
  }

  void session() {
    Bidi<v1::SessionRequest, v1::SessionResponse> call([this](grpc::ClientContext* context) {
      authorize(*context, alice_);
      return solver().Session(context);
    });
    v1::SessionRequest request;
    *request.mutable_setup()->mutable_problem() = example_request().problem();
    ASSERT_TRUE(call.write(request) && call.next());
    for (int sequence = 1; sequence <= kUpdates; ++sequence) {
      request.mutable_update()->set_sequence(sequence);
      ASSERT_TRUE(call.write(request));
      const auto answer = call.next();
      ASSERT_TRUE(answer && answer->has_answer());
      seen_.solved("alice", answer->answer().solution());
      seen_.add("marble_session_updates_answered_total");
    }
    ASSERT_TRUE(call.write(request));  // the same number again
    const auto error = call.next();
    ASSERT_TRUE(error && error->has_error());
    seen_.add("marble_session_updates_refused_total{reason=\"invalid_argument\"}");
    call.done();
    seen_.called("Solver/Session", call.finish());
    seen_.add("marble_sessions_opened_total");
    seen_.add("marble_sessions", 0.0);
    seen_.add("marble_session_memory_bytes", 0.0);
    seen_.add("sum(marble_queue_wait_seconds_count{priority=\"realtime\"})", 1.0 + kUpdates);
  }

  void batch() {
    Bidi<v1::SolveBatchRequest, v1::SolveBatchResponse> call([this](grpc::ClientContext* context) {
      authorize(*context, bob_);
      return solver().SolveBatch(context);
    });
    v1::SolveBatchRequest request;
    *request.mutable_solve() = example_request();
    for (int tag = 0; tag < kBatch; ++tag) call.write(request);
    call.done();
    for (const v1::SolveBatchResponse& response : call.drain()) {
      ASSERT_TRUE(response.has_result());
      seen_.solved("bob", response.result().solution());
      seen_.add("marble_jobs_accepted_total");
      seen_.add("marble_jobs_answered_total");
    }
    seen_.called("Solver/SolveBatch", call.finish());
  }

  /// One job takes the only worker, another is refused, and the first is cancelled.
  void refused_while_full() {
    grpc::ClientContext stream, cancel;
    authorize(stream, alice_);
    authorize(cancel, alice_);
    v1::SolveStreamRequest request;
    *request.mutable_solve() = long_request();
    const auto reader = solver().SolveStream(&stream, request);
    v1::CancelJobRequest which;
    for (Event event; reader->Read(&event);) {
      seen_.add("marble_progress_rows_sent_total", event.progress().rows_size());
      if (event.has_accepted()) which.set_job_id(event.accepted().job_id());
      if (event.has_result()) seen_.solved("alice", event.result().solution());
      if (!event.has_started()) continue;
      unary(example_request(), bob_);
      v1::CancelJobResponse cancelled;
      const auto jobs = v1::Jobs::NewStub(channel());
      seen_.called("Jobs/Cancel", jobs->Cancel(&cancel, which, &cancelled));
    }
    seen_.called("Solver/SolveStream", reader->Finish());
    seen_.add("marble_jobs_accepted_total");
    seen_.add("marble_jobs_cancelled_total");
    seen_.add("marble_jobs_refused_total{reason=\"queue_jobs\"}");
  }

  void authorize(grpc::ClientContext& context, const Token& token) const {
    context.AddMetadata("authorization", "Bearer " + token.secret);
  }
  [[nodiscard]] std::string client_of(const Token& token) const {
    return token.secret == alice_.secret ? "alice" : "bob";
  }
  [[nodiscard]] httplib::Result metrics(const std::string& token) {
    return httplib::Client(server().http()).Get("/metrics", {{"Authorization", "Bearer " + token}});
  }
  [[nodiscard]] bool eventually_gives(const std::string& query, double value) {
    return eventually([&] { return prometheus_->value(query) == value; });
  }
  /// Runs promtool in deploy/prometheus; what it says is no good, or nothing.
  [[nodiscard]] std::string promtool(const std::string& arguments) {
    const std::string output = directory_.file("promtool " + std::to_string(++promtools_));
    ChildProcess process(
        {"/bin/sh", "-c",
         "cd '" + kDeploy + "/prometheus' && exec '" MARBLE_PROMTOOL_BINARY "' " + arguments},
        output);
    return process.wait() == 0 ? "" : "failed: " + process.output();
  }
  /// Name → type, as the server reports them.
  [[nodiscard]] std::map<std::string, std::string> metric_types() {
    const std::string table = run({"--print-metrics"}).output;
    std::map<std::string, std::string> types;
    const std::regex row("\\| `([a-z_]+)` \\| ([a-z]+) \\|");
    for (std::sregex_iterator match(table.begin(), table.end(), row), end; match != end; ++match)
      types[(*match)[1]] = (*match)[2];
    return types;
  }

  Token alice_ = new_token("alice:solve"), bob_ = new_token("bob:solve"), eye_ = new_token("eye:observe");
  std::unique_ptr<PrometheusProcess> prometheus_;
  Seen seen_;

 private:
  int promtools_ = 0;
};

/// The metrics that an expression asks for; of a histogram, its name without _bucket, _sum and _count.
std::set<std::string> metrics_in(const std::string& expression,
                                 const std::map<std::string, std::string>& types) {
  static const std::regex name("\\b(marble|process)_[a-z_]+"), part("_(bucket|sum|count)$");
  std::set<std::string> names;
  for (std::sregex_iterator match(expression.begin(), expression.end(), name), end; match != end; ++match) {
    const std::string whole = match->str(), histogram = std::regex_replace(whole, part, "");
    const auto found = types.find(histogram);
    names.insert(found != types.end() && found->second == "histogram" && histogram != whole ? histogram
                                                                                            : whole);
  }
  return names;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

/// The dashboard's queries, with its variables as they are when everything is chosen.
std::vector<std::string> dashboard_queries() {
  std::vector<std::string> queries;
  const auto dashboard = nlohmann::json::parse(read_file(kDeploy + "/grafana/marble.json"));
  for (const auto& panel : dashboard.at("panels")) {
    for (const auto& target : panel.value("targets", nlohmann::json::array())) {
      std::string query = replaced(target.at("expr"), "$__rate_interval", "1m");
      queries.push_back(replaced(replaced(query, "$job", ".*"), "$instance", ".*"));
    }
  }
  return queries;
}

TEST_F(Prometheus, SumsAreWhatTheClientsSaw) {
  start_scraped();
  load();
  for (const auto& [query, value] : seen_.sums()) {
    EXPECT_TRUE(eventually_gives(query, value))
        << query << " is " << prometheus_->value(query) << " and not " << value;
  }
  const v1::Counters reported = ask(bearer(eye_.secret)).info.counters();
  EXPECT_TRUE(eventually_gives("marble_jobs_accepted_total", static_cast<double>(reported.accepted_total())));
  EXPECT_TRUE(
      eventually_gives("sum(marble_jobs_refused_total)", static_cast<double>(reported.refused_total())));
  EXPECT_TRUE(eventually_gives("sum(marble_solves_total)",
                               static_cast<double>(reported.answered_total() + 1 + reported.updates_total())))
      << "answers, the cancelled job's iterate, and updates";
}

TEST_F(Prometheus, EveryQueryOfTheDashboardHasAnAnswer) {
  start_scraped();
  load();
  const std::vector<std::string> queries = dashboard_queries();
  EXPECT_GE(queries.size(), 40U);
  for (const std::string& query : queries) {
    const auto has_samples = [&] {
      const nlohmann::json answer = prometheus_->query(query);
      return answer.at("status") == "success" && !answer.at("data").at("result").empty();
    };
    EXPECT_TRUE(eventually(has_samples)) << query << "\n" << prometheus_->query(query).dump();
  }
}

TEST_F(Prometheus, EveryAlertIsEvaluatedAndAHealthyServerRaisesNone) {
  start_scraped();
  const auto evaluated = [&] {
    const nlohmann::json groups = prometheus_->get("rules").at("data").at("groups");
    const auto is_ok = [](const auto& rule) { return rule.at("health") == "ok"; };
    return groups.size() == 1 && groups[0].at("rules").size() >= 10 &&
           std::ranges::all_of(groups[0].at("rules"), is_ok);
  };
  EXPECT_TRUE(eventually(evaluated)) << prometheus_->get("rules").dump();
  EXPECT_TRUE(prometheus_->get("alerts").at("data").at("alerts").empty())
      << prometheus_->get("alerts").dump();
}

TEST_F(Prometheus, DashboardAndAlertsNameOnlyMetricsThatThereAre) {
  const auto types = metric_types();
  ASSERT_GE(types.size(), 40U);
  std::string expressions = read_file(kDeploy + "/prometheus/alerts.yml");
  for (const std::string& query : dashboard_queries()) expressions += "\n" + query;
  const auto named = metrics_in(expressions, types);
  EXPECT_GE(named.size(), 30U);
  for (const std::string& name : named) EXPECT_EQ(types.count(name), 1U) << name;
}

TEST_F(Prometheus, ItsToolFindsNoFaultInTheFilesOfDeploy) {
  EXPECT_EQ(promtool("check config prometheus.yml"), "");
  EXPECT_EQ(promtool("check rules alerts.yml"), "");
  EXPECT_EQ(promtool("test rules alerts_test.yml"), "");
}

TEST_F(Prometheus, ItsToolFindsNoFaultInTheMetrics) {
  start({"--http", "127.0.0.1:0"});
  ASSERT_TRUE(lives());
  const auto reported = metrics("");
  ASSERT_EQ(reported->status, 200);
  EXPECT_EQ(reported->get_header_value("Content-Type"), "text/plain; version=0.0.4; charset=utf-8");
  EXPECT_EQ(promtool("check metrics < '" + write("metrics", reported->body) + "'"), "");
}

TEST_F(Prometheus, MetricsAreForObservers) {
  start({"--tokens", write("tokens", alice_.line + eye_.line), "--http", "127.0.0.1:0"});
  EXPECT_EQ(metrics(eye_.secret)->status, 200);
  EXPECT_EQ(metrics(alice_.secret)->status, 403);
  EXPECT_EQ(metrics("wrong")->status, 401);
}

TEST_F(Prometheus, OffThereAreNone) {
  start({"--metrics=false", "--http", "127.0.0.1:0"});
  EXPECT_TRUE(lives());
  EXPECT_EQ(metrics("")->status, 404);
}

TEST_F(Prometheus, AMethodThatIsNotThereMakesNoSeriesOfItsOwn) {
  start({"--http", "127.0.0.1:0"});
  for (const char* method : {"/marble.v1.Solver/Nothing", "/guess/Work"})
    EXPECT_EQ(raw_call(channel(), method, "").status.error_code(), grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_EQ(health(), "SERVING");
  const std::string reported = metrics("")->body;
  EXPECT_EQ(reported.find("Nothing"), std::string::npos);
  EXPECT_EQ(reported.find("guess"), std::string::npos);
  EXPECT_NE(reported.find(R"(marble_rpcs_total{code="OK",method="grpc.health.v1.Health/Check"} 1)"),
            std::string::npos);
}

}  // namespace
}  // namespace marble::testing
