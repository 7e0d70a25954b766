#include <array>
#include <limits>
#include <map>
#include <thread>

#include "client.h"
#include "google/rpc/status.pb.h"
#include "judgement.h"
#include "problems.h"
#include "service_test.h"

// Unary solves: right ones, late ones, malformed ones.
namespace marble::testing {
namespace {

class SolveClient final : public Client {
 public:
  SolveClient(Environment& environment, std::uint64_t seed) : Client(environment, "solves", seed) {}

 private:
  void episode() override {
    const auto& problems = small_problems();
    v1::SolveRequest request =
        problems[static_cast<std::size_t>(pick(0, static_cast<int>(problems.size()) - 1))];
    request.set_request_id("solve-" + std::to_string(++number_));
    request.set_priority(static_cast<v1::Priority>(pick(v1::PRIORITY_UNSPECIFIED, v1::PRIORITY_BATCH)));
    const auto context = new_context();
    v1::SolveResponse response;
    if (ended(solver().Solve(context.get(), request, &response), "solve"))
      answered(request.problem(), response.solution());
    if (chance(0.2)) dawdle(20);
  }

  int number_ = 0;
};

// Deadlines that pass while the job waits, while it runs, and now and then just not.
class DeadlineClient final : public Client {
 public:
  DeadlineClient(Environment& environment, std::uint64_t seed)
      : Client(environment, "deadline misses", seed) {}

 private:
  void episode() override {
    const bool hopeless = chance(0.7);
    const v1::SolveRequest request = hopeless ? long_request() : small_problems()[2];
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::microseconds(pick(50, 60'000)));
    v1::SolveResponse response;
    const grpc::Status status = solver().Solve(&context, request, &response);
    if (!ended(status, "late solve", {Code::DEADLINE_EXCEEDED})) return;
    answered(request.problem(), response.solution());
    if (hopeless) expect(disturbed(), "an answer to what takes for ever");
  }
};

class MalformedClient final : public Client {
 public:
  MalformedClient(Environment& environment, std::uint64_t seed) : Client(environment, "malformed", seed) {}

 private:
  void episode() override {
    switch (pick(0, 3)) {
      case 0:
        return solve_broken();
      case 1:
        return send_noise();
      case 2:
        return set_up_broken();
      default:
        return update_before_set_up();
    }
  }

  [[nodiscard]] v1::SolveRequest broken() {
    v1::SolveRequest request = example_request();
    v1::Problem& problem = *request.mutable_problem();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    switch (pick(0, 6)) {
      case 0:
        problem.set_gradient(pick(0, 3), nan);
        break;
      case 1:
        problem.add_gradient(1.0);
        break;
      case 2:
        problem.mutable_equality_matrix()->set_row_indices(0, pick(1, 1'000'000'000));
        break;
      case 3:
        problem.mutable_left_matrix()->set_column_pointers(1, -pick(1, 1'000'000'000));
        break;
      case 4:
        problem.mutable_hessian()->set_rows(std::numeric_limits<int>::max());
        break;
      case 5:
        request.mutable_options()->set_equality_tolerance(nan);
        break;
      default:
        request.set_request_id(std::string(1000, '\n'));
        break;
    }
    return request;
  }

  void solve_broken() {
    const auto context = new_context();
    v1::SolveResponse response;
    expect(
        !ended(solver().Solve(context.get(), broken(), &response), "broken solve", {Code::INVALID_ARGUMENT}),
        "a broken problem was solved");
  }

  // Bytes that are no message, or half of one.
  void send_noise() {
    const std::array methods = {"Solver/Solve", "Solver/SolveStream", "Solver/SolveBatch", "Solver/Session",
                                "Jobs/Submit",  "Jobs/Watch",         "Jobs/Bundle"};
    std::string bytes = example_request().SerializeAsString();
    bytes.resize(static_cast<std::size_t>(pick(1, static_cast<int>(bytes.size()) - 1)));
    for (int i = pick(1, 20); i > 0; --i)
      bytes[static_cast<std::size_t>(pick(0, static_cast<int>(bytes.size()) - 1))] =
          static_cast<char>(pick(-128, 127));
    const std::string method = methods[static_cast<std::size_t>(pick(0, methods.size() - 1))];
    if (method == "Jobs/Watch") bytes = "\xff" + bytes;  // what it takes for a watch of all would never end
    const RawAnswer answer = raw_call(channel(), "/marble.v1." + method, bytes);
    if (answer.status.error_code() == Code::INVALID_ARGUMENT) {
      count("INVALID_ARGUMENT");  // what cannot be parsed has no field to name
    } else {
      // What by chance is a message may have any answer.
      ended(answer.status, "noise to " + method,
            {Code::FAILED_PRECONDITION, Code::NOT_FOUND, Code::CANCELLED});
    }
  }

  void set_up_broken() {
    const auto context = new_context();
    const auto stream = solver().Session(context.get());
    v1::SessionRequest request;
    *request.mutable_setup()->mutable_problem() = std::move(*broken().mutable_problem());
    request.mutable_setup()->mutable_problem()->add_gradient(0.0);
    stream->Write(request);
    v1::SessionResponse response;
    expect(!stream->Read(&response), "a broken set-up was taken");
    ended(stream->Finish(), "broken set-up", {Code::INVALID_ARGUMENT});
  }

  void update_before_set_up() {
    const auto context = new_context();
    const auto stream = solver().Session(context.get());
    v1::SessionRequest request;
    request.mutable_update()->set_sequence(1);
    stream->Write(request);
    v1::SessionResponse response;
    expect(!stream->Read(&response), "an update before the set-up was answered");
    ended(stream->Finish(), "update before set-up", {Code::FAILED_PRECONDITION});
  }
};

}  // namespace

std::unique_ptr<Client> make_solve_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<SolveClient>(environment, seed);
}

std::unique_ptr<Client> make_deadline_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<DeadlineClient>(environment, seed);
}

std::unique_ptr<Client> make_malformed_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<MalformedClient>(environment, seed);
}

}  // namespace marble::testing

// Many problems on one stream: every tag has one outcome.
namespace marble::testing {
namespace {

class BatchClient final : public Client {
 public:
  BatchClient(Environment& environment, std::uint64_t seed) : Client(environment, "batches", seed) {}

 private:
  void episode() override {
    const bool given_up = chance(0.3);
    const int size = pick(1, 120);
    std::vector<int> kinds;  // of each tag: which of the small problems, or -1 for a malformed one
    for (int tag = 0; tag < size; ++tag)
      kinds.push_back(chance(0.05) ? -1 : pick(0, static_cast<int>(small_problems().size()) - 1));
    const auto context = new_context();
    const auto stream = solver().SolveBatch(context.get());
    std::thread writer([&] {
      for (int tag = 0; tag < size; ++tag) {
        v1::SolveBatchRequest request;
        request.set_tag(tag);
        const int kind = kinds[static_cast<std::size_t>(tag)];
        if (kind >= 0) *request.mutable_solve() = small_problems()[static_cast<std::size_t>(kind)];
        if (!stream->Write(request)) break;
      }
      stream->WritesDone();
    });
    std::map<std::int64_t, int> outcomes;
    int until_given_up = given_up ? pick(0, size) : -1;
    if (until_given_up == 0) context->TryCancel();
    for (v1::SolveBatchResponse response; stream->Read(&response);) {
      ++outcomes[response.tag()];
      if (response.tag() < 0 || response.tag() >= size) {
        fault("a tag nobody sent");
      } else {
        take(response, kinds[static_cast<std::size_t>(response.tag())]);
      }
      if (--until_given_up == 0) context->TryCancel();
    }
    writer.join();
    const grpc::Status status = stream->Finish();
    const bool ok = given_up ? ended(status, "batch given up", {Code::CANCELLED}) : ended(status, "batch");
    for (const auto& [tag, times] : outcomes) expect(times == 1, "a tag was answered twice");
    if (ok) expect(outcomes.size() == static_cast<std::size_t>(size), "tags without an outcome");
  }

  void take(const v1::SolveBatchResponse& response, int kind) {
    if (kind < 0) {
      expect(response.has_error(), "a malformed problem was solved");
      ended(response.error(), "malformed item", {Code::INVALID_ARGUMENT});
    } else if (response.has_result()) {
      answered(small_problems()[static_cast<std::size_t>(kind)].problem(), response.result().solution());
    } else {
      ended(response.error(), "item");
    }
  }
};

}  // namespace

std::unique_ptr<Client> make_batch_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<BatchClient>(environment, seed);
}

}  // namespace marble::testing
