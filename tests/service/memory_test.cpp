// The sum of memory limits that server/OPERATE.md documents holds, whatever requests ask for.
// MARBLE_MEMORY_REQUESTS says how many requests each client sends (default 10), MARBLE_MEMORY_SEED which.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bidi.h"
#include "http_service_test.h"

namespace marble::testing {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kMemoryIsMeasurable = false;  // shadows and quarantines are resident too
#else
constexpr bool kMemoryIsMeasurable = true;
#endif

constexpr std::int64_t kMiB = std::int64_t{1} << 20;

int number_from(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::atoi(text);
}

// Of proc_pid_status(5), in bytes.
std::int64_t peak_resident_bytes(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("VmHWM:")) return std::stoll(line.substr(6)) * 1024;
  }
  return 0;
}

// Row i has one entry, in column (first + i * step) modulo `columns`.
void set_selection(v1::SparseMatrix* matrix, int rows, int columns, int first = 0) {
  matrix->set_rows(rows);
  matrix->set_columns(columns);
  std::vector<std::vector<int>> rows_of(static_cast<std::size_t>(columns));
  for (int i = 0; i < rows; ++i) rows_of[static_cast<std::size_t>((first + i) % columns)].push_back(i);
  matrix->add_column_pointers(0);
  for (const std::vector<int>& column : rows_of) {
    for (const int row : column) {
      matrix->add_row_indices(row);
      matrix->add_values(1.0);
    }
    matrix->add_column_pointers(matrix->row_indices_size());
  }
}

// Every entry: large on the diagonal.
void set_dense(v1::SparseMatrix* matrix, int rows, int columns) {
  matrix->set_rows(rows);
  matrix->set_columns(columns);
  for (int j = 0; j <= columns; ++j) matrix->add_column_pointers(j * rows);
  for (int j = 0; j < columns; ++j) {
    for (int i = 0; i < rows; ++i) {
      matrix->add_row_indices(i);
      matrix->add_values(i == j ? 2.0 * rows : 1.0 / (1 + i + j));
    }
  }
}

using Numbers = google::protobuf::RepeatedField<double>;
void fill(Numbers* numbers, int count, double value) { numbers->Resize(count, value); }

class Memory : public HttpServiceTest {
 protected:
  using Random = std::mt19937;

  // 2^low to 2^high, each power as likely.
  static int power(Random& random, int low, int high) {
    return 1 << std::uniform_int_distribution<int>(low, high)(random);
  }

  // Diagonal or dense; a quarter of the variables are in pairs with the next quarter.
  static void set_problem(v1::Problem* problem, int n, bool dense) {
    if (dense) {
      set_dense(problem->mutable_hessian(), n, n);
    } else {
      set_selection(problem->mutable_hessian(), n, n);
    }
    fill(problem->mutable_gradient(), n, -1.0);
    const int pairs = n / 4;
    if (pairs == 0) return;
    set_selection(problem->mutable_left_matrix(), pairs, n);
    set_selection(problem->mutable_right_matrix(), pairs, n, pairs);
    fill(problem->mutable_left_offset(), pairs, 0.1);
    fill(problem->mutable_right_offset(), pairs, 0.1);
  }

  static v1::SolveRequest limited() {
    v1::SolveRequest request;
    request.mutable_options()->set_time_limit_s(0.5);
    return request;
  }

  static v1::SolveRequest plain(Random& random) {
    v1::SolveRequest request = limited();
    const bool dense = random() % 2 == 0;
    set_problem(request.mutable_problem(), power(random, 8, dense ? 11 : 18), dense);
    request.mutable_options()->set_num_starts(power(random, 0, 20));
    return request;
  }
  static v1::SolveRequest tree(Random& random) {
    v1::SolveRequest request = limited();
    set_problem(request.mutable_problem(), power(random, 5, 13), random() % 2 == 0 && random() % 2 == 0);
    if (request.problem().hessian().values_size() > (1 << 20)) request.mutable_problem()->Clear();
    request.mutable_options()->set_global_search(true);
    request.mutable_options()->set_node_limit(1'000'000'000);
    return request;
  }
  static v1::SolveRequest scenarios(Random& random) {
    v1::SolveRequest request = limited();
    const int n = power(random, 6, 17);
    set_problem(request.mutable_problem(), n, false);
    v1::Scenarios* scenarios = request.mutable_scenarios();
    scenarios->add_first_stage(0);
    v1::ScenarioQuantity* quantity = scenarios->mutable_sampler()->add_quantities();
    quantity->set_distribution(v1::ScenarioQuantity::DISTRIBUTION_NORMAL);
    v1::ScenarioEffect* effect = quantity->add_effects();
    effect->mutable_entries()->set_part(v1::PROBLEM_PART_GRADIENT);
    effect->add_gains(0.01);
    const int most = power(random, 4, 11);
    scenarios->set_max_sample_size(most);
    scenarios->set_initial_sample_size(random() % 2 == 0 ? most : 1);
    scenarios->set_out_of_sample_scenarios(power(random, 0, 11));
    return request;
  }
  static v1::SolveRequest blocks(Random& random) {
    v1::SolveRequest request = limited();
    const int count = power(random, 0, 9), rows = power(random, 0, 10), n = power(random, 2, 8);
    for (int k = 0; k < count; ++k) {
      v1::CoupledBlock* block = request.mutable_coupled()->add_blocks();
      set_problem(block->mutable_problem(), n, false);
      set_selection(block->mutable_coupling(), rows, n, k);
    }
    fill(request.mutable_coupled()->mutable_coupling_rhs(), rows, 1.0);
    return request;
  }
  static v1::SolveRequest segments(Random& random) {
    v1::SolveRequest request = limited();
    const int n = power(random, 8, 17);
    set_problem(request.mutable_problem(), n, false);
    v1::Segments* segments = request.mutable_coupled()->mutable_segments();
    for (int i = 0; i < n; ++i) segments->add_stages(i);
    segments->set_num_segments(std::min(n, power(random, 0, 9)));
    return request;
  }
  static v1::SolveRequest sensitivity(Random& random) {
    v1::SolveRequest request = limited();
    const int n = power(random, 6, 14);
    set_problem(request.mutable_problem(), n, false);
    const int count = std::min(1000, power(random, 0, 10));
    if (random() % 2 == 0) {
      v1::DirectionsRequest* directions = request.mutable_sensitivity()->mutable_directions();
      directions->set_count(count);
      fill(directions->mutable_numbers()->mutable_gradient(), std::min(count * n, 1 << 22), 1.0);
    } else {
      v1::RowsRequest* rows = request.mutable_sensitivity()->mutable_rows();
      set_selection(rows->mutable_matrix(), std::min(count, n), n);
      rows->set_columns(true);
    }
    return request;
  }

  void send_solve(const v1::SolveRequest& request) {
    v1::SolveResponse response;
    (void)solve(request, &response, std::chrono::seconds(100));
  }
  void send_submit(const v1::SolveRequest& request) {
    grpc::ClientContext context;
    v1::SubmitResponse response;
    (void)v1::Jobs::NewStub(channel())->Submit(&context, request, &response);
  }
  // More than the server takes at once, and no answer is read before all are sent.
  void send_batch(Random& random) {
    Bidi<v1::SolveBatchRequest, v1::SolveBatchResponse> call(
        [this](grpc::ClientContext* context) { return solver().SolveBatch(context); });
    v1::SolveBatchRequest request;
    *request.mutable_solve() = limited();
    set_problem(request.mutable_solve()->mutable_problem(), power(random, 8, 15), false);
    for (int i = 0; i < 16 && call.write(request); ++i) request.set_tag(i);
    call.done();
    (void)call.drain();
  }
  void send_session(Random& random) {
    Bidi<v1::SessionRequest, v1::SessionResponse> call(
        [this](grpc::ClientContext* context) { return solver().Session(context); });
    const int n = power(random, 8, 16);
    v1::SessionRequest request;
    *request.mutable_setup()->mutable_options() = limited().options();
    set_problem(request.mutable_setup()->mutable_problem(), n, n <= 1024);
    if (!call.write(request) || !call.next()) return;
    request.Clear();
    request.mutable_update()->mutable_options()->set_time_limit_s(0.05);
    for (int i = 0; i < 16; ++i) {
      request.mutable_update()->set_sequence(i);
      fill(request.mutable_update()->mutable_problem()->mutable_gradient(), n, 1.0 + i);
      if (!call.write(request)) break;
    }
    call.done();
    (void)call.drain();
  }
  void send_over_http(Random& random) {
    const int n = power(random, 10, 17);
    std::string text = R"({"problem": {"n": )" + std::to_string(n) + R"(, "g": [1)";
    for (int i = 1; i < n; ++i) text += ",1e-9";
    text += R"(], "Q": {"rows": )" + std::to_string(n) + R"(, "cols": )" + std::to_string(n);
    for (const char* key : {"i", "j"}) {
      text += std::string(", \"") + key + "\": [0";
      for (int i = 1; i < n; ++i) text += "," + std::to_string(i);
      text += "]";
    }
    text += ", \"v\": [1";
    for (int i = 1; i < n; ++i) text += ",1";
    text += "]}}, \"options\": {\"time_limit_s\": 0.5}}";
    const auto accepted = post(text);
    if (!accepted || accepted->status != 202) return;
    const std::string path = "/api/jobs/" + Json::parse(accepted->body).at("job_id").get<std::string>();
    (void)get(path + "/result?wait=30");
    // An answer that is asked for and not read.
    const int unread = connected_to(server().http());
    const std::string line = "GET " + path + "/result HTTP/1.1\r\nHost: localhost\r\n\r\n";
    (void)!send(unread, line.data(), line.size(), MSG_NOSIGNAL);
    (void)get("/healthz");
    close(unread);
  }
};

TEST_F(Memory, StaysWithinTheDocumentedSumWhateverRequestsAskFor) {
  const std::int64_t queue = 64 * kMiB, session = 96 * kMiB, result = 16 * kMiB, transport = 64 * kMiB;
  const std::int64_t solve = 96 * kMiB;
  const int workers = 2;
  const auto text = [](std::int64_t bytes) { return std::to_string(bytes); };
  start({"--workers", std::to_string(workers), "--queue-bytes", text(queue), "--session-bytes", text(session),
         "--result-bytes", text(result), "--transport-bytes", text(transport), "--solve-bytes", text(solve),
         "--sensitivity-bytes", text(queue / 2), "--client-queued", "0", "--client-sessions", "0"});
  ASSERT_TRUE(lives());
  const std::int64_t at_start = peak_resident_bytes(server().pid());
  const int requests = number_from("MARBLE_MEMORY_REQUESTS", 10);
  const auto seed = static_cast<unsigned>(number_from("MARBLE_MEMORY_SEED", 1));
  const std::array<std::pair<const char*, v1::SolveRequest (*)(Random&)>, 6> kinds = {
      {{"plain", plain},
       {"tree", tree},
       {"scenarios", scenarios},
       {"blocks", blocks},
       {"segments", segments},
       {"sensitivity", sensitivity}}};
  std::vector<std::thread> clients;
  unsigned number = 0;
  const auto add_client = [&](const std::function<void(Random&)>& episode) {
    clients.emplace_back([=, client = number++] {
      Random random(100 * seed + client);
      for (int i = 0; i < requests; ++i) episode(random);
    });
  };
  for (const auto& [name, make] : kinds) {
    add_client([this, make = make](Random& random) {
      const v1::SolveRequest request = make(random);
      if (random() % 4 == 0) {
        send_submit(request);
      } else {
        send_solve(request);
      }
    });
  }
  add_client([this](Random& random) { send_batch(random); });
  add_client([this](Random& random) { send_session(random); });
  add_client([this](Random& random) { send_over_http(random); });
  for (std::thread& client : clients) client.join();
  EXPECT_TRUE(lives());
  EXPECT_TRUE(eventually_idle()) << counters().DebugString();
  const std::int64_t peak = peak_resident_bytes(server().pid());
  const std::int64_t sum = queue + session + result + 2 * transport + workers * solve;
  std::printf("resident: %lld MiB at the start, %lld MiB at most; the limits' sum is %lld MiB\n",
              static_cast<long long>(at_start / kMiB), static_cast<long long>(peak / kMiB),
              static_cast<long long>(sum / kMiB));
  if (!kMemoryIsMeasurable) return;
  EXPECT_LE(peak, at_start + sum * 10 / 9);
}

}  // namespace
}  // namespace marble::testing
