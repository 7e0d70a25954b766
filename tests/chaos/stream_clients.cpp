#include <array>
#include <thread>

#include "client.h"
#include "judgement.h"
#include "problems.h"
#include "support/child_process.h"

// Streamed solves: read to the end, given up at any moment, hardly read at all.
namespace marble::testing {
namespace {

using Event = v1::SolveStreamResponse;

// The contract's order of events, and one result.
class Order {
 public:
  /// Empty, or what is wrong with this event where it comes.
  [[nodiscard]] std::string take(const Event& event) {
    const int step = step_of(event.event_case());
    const bool first = step_ == 0;
    const bool again = step == step_ && (event.has_progress() || event.has_queued());
    const bool right = !result_ && (first ? event.has_accepted() : step > step_ || again);
    step_ = step;
    result_ = result_ || event.has_result();
    return right ? "" : "event " + std::to_string(event.event_case()) + " out of order";
  }
  [[nodiscard]] bool result() const { return result_; }

 private:
  static int step_of(Event::EventCase kind) {
    switch (kind) {
      case Event::kAccepted:
        return 1;
      case Event::kQueued:
        return 2;
      case Event::kStarted:
        return 3;
      case Event::kProgress:
        return 4;
      case Event::kResult:
        return 5;
      default:
        return 0;
    }
  }
  int step_ = 0;
  bool result_ = false;
};

class StreamClient final : public Client {
 public:
  StreamClient(Environment& environment, std::uint64_t seed) : Client(environment, "streams", seed) {}

 private:
  void episode() override {
    v1::SolveStreamRequest request;
    *request.mutable_solve() = chance(0.3) ? long_request(pick(1, 60)) : small_problems()[2];
    if (chance(0.5)) request.set_iterate_every(pick(1, 10));
    if (chance(0.3)) request.set_progress_interval_s(0.005);
    const auto context = new_context();
    const auto reader = solver().SolveStream(context.get(), request);
    Order order;
    for (Event event; reader->Read(&event);) {
      if (const std::string wrong = order.take(event); !wrong.empty()) fault(wrong);
      if (event.has_result()) answered(request.solve().problem(), event.result().solution());
    }
    const bool ok = ended(reader->Finish(), "stream");
    expect(ok == order.result() || disturbed(), "a stream ends with OK and a result, or with neither");
  }
};

class CancelClient final : public Client {
 public:
  CancelClient(Environment& environment, std::uint64_t seed) : Client(environment, "cancels", seed) {}

 private:
  void episode() override {
    v1::SolveStreamRequest request;
    *request.mutable_solve() = long_request();
    const auto context = new_context();
    const auto reader = solver().SolveStream(context.get(), request);
    int left = pick(0, 6);
    bool by_id = false;
    for (Event event; reader->Read(&event);) {
      if (event.has_result()) {
        expect(event.result().solution().status() == v1::STATUS_CANCELLED,
               "ended as " + v1::Status_Name(event.result().solution().status()));
        answered(request.solve().problem(), event.result().solution());
      }
      if (left-- != 0) continue;
      by_id = event.has_accepted() && chance(0.5);
      if (by_id) {
        cancel(event.accepted().job_id());
      } else {
        context->TryCancel();
      }
    }
    if (left >= 0) context->TryCancel();
    ended(reader->Finish(), by_id ? "stream cancelled by id" : "cancelled stream", {Code::CANCELLED});
  }

  void cancel(const std::string& id) {
    dawdle(20);
    const auto context = new_context();
    v1::CancelJobRequest request;
    request.set_job_id(id);
    v1::CancelJobResponse response;
    // It may have been cancelled, finished and forgotten on the way.
    ended(jobs().Cancel(context.get(), request, &response), "cancel", {Code::NOT_FOUND});
  }
};

// Large iterates with every row, and nobody who reads them for a while.
class SlowReader final : public Client {
 public:
  SlowReader(Environment& environment, std::uint64_t seed) : Client(environment, "slow readers", seed) {}

 private:
  void episode() override {
    v1::SolveStreamRequest request;
    *request.mutable_solve() = long_request(pick(20, 120));
    request.set_iterate_every(1);
    const auto context = new_context();
    const auto reader = solver().SolveStream(context.get(), request);
    Order order;
    Event event;
    for (int i = pick(0, 4); i > 0 && reader->Read(&event); --i) take(order, event);
    for (int i = pick(2, 20); i > 0 && !environment().stopped(); --i) dawdle(100);
    const bool given_up = chance(0.5);
    if (given_up) context->TryCancel();
    while (reader->Read(&event)) take(order, event);
    const grpc::Status status = reader->Finish();
    if (given_up) {
      ended(status, "slow stream given up", {Code::CANCELLED});
    } else {
      const bool ok = ended(status, "slow stream");
      expect(ok == order.result() || disturbed(), "a slow stream ends with OK and a result, or with neither");
    }
  }

  void take(Order& order, const Event& event) {
    if (const std::string wrong = order.take(event); !wrong.empty()) fault(wrong);
    count("events");
  }
};

}  // namespace

std::unique_ptr<Client> make_stream_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<StreamClient>(environment, seed);
}

std::unique_ptr<Client> make_cancel_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<CancelClient>(environment, seed);
}

std::unique_ptr<Client> make_slow_reader(Environment& environment, std::uint64_t seed) {
  return std::make_unique<SlowReader>(environment, seed);
}

}  // namespace marble::testing

// Clients that vanish without a word: processes killed with -9.
namespace marble::testing {
namespace {

class KilledClient final : public Client {
 public:
  KilledClient(Environment& environment, std::uint64_t seed) : Client(environment, "killed with -9", seed) {}

 private:
  void episode() override {
    static constexpr std::array kKinds = {"stream", "batch", "session"};
    const std::string kind = kKinds[static_cast<std::size_t>(pick(0, 2))];
    const std::string output = directory_.file(std::to_string(++number_));
    // Of this thread, which lives on: a child is killed with the thread that started it.
    ChildProcess victim({STREAM_CLIENT_BINARY, environment().address(), kind}, output);
    const bool reported = eventually([&] { return !victim.output().empty() || !victim.running(); });
    expect(reported, "a " + kind + " that never ran");
    dawdle(100);
    count(victim.running() ? "killed " + kind : "ended before");
    victim.send(SIGKILL);
    victim.wait();
    std::filesystem::remove(output);
  }

  TemporaryDirectory directory_;
  int number_ = 0;
};

}  // namespace

std::unique_ptr<Client> make_killed_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<KilledClient>(environment, seed);
}

}  // namespace marble::testing
