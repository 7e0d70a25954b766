// Sessions: every update is answered once and in order, for the problem as it then is; and sessions left
// open.
#include <algorithm>
#include <deque>

#include "client.h"
#include "google/rpc/status.pb.h"
#include "judgement.h"
#include "marble/examples.h"

namespace marble::testing {
namespace {

using Stream = grpc::ClientReaderWriter<v1::SessionRequest, v1::SessionResponse>;

class SessionClient final : public Client {
 public:
  SessionClient(Environment& environment, std::uint64_t seed) : Client(environment, "sessions", seed) {}

 private:
  struct Sent {
    v1::SessionUpdate update;
    bool malformed = false;
    bool over = false;    // has its outcome
    bool counts = false;  // its numbers are those of the next answer, unless a later one changes them
  };

  void episode() override {
    const auto context = new_context();
    const auto stream = solver().Session(context.get());
    problem_ = small_problems()[static_cast<std::size_t>(pick(1, 3))].problem();
    latest_only_ = chance(0.3);
    sent_.clear();
    v1::SessionRequest first;
    *first.mutable_setup()->mutable_problem() = problem_;
    first.mutable_setup()->set_latest_only(latest_only_);
    first.mutable_setup()->set_progress(chance(0.3));
    stream->Write(first);
    v1::SessionResponse response;
    const bool ready = stream->Read(&response);
    if (ready) expect(response.has_ready() && response.ready().memory_bytes() > 0, "not ready first");
    const bool given_up = chance(0.2);
    if (ready) converse(*stream, given_up ? context.get() : nullptr);
    if (!ready || !given_up) stream->WritesDone();
    while (stream->Read(&response)) take(response);
    const grpc::Status status = stream->Finish();
    const bool ok =
        given_up ? ended(status, "session given up", {Code::CANCELLED}) : ended(status, "session");
    expect(!ok || !waits(), "updates without an outcome");
  }

  // Some updates at once, then their answers, and so on.
  void converse(Stream& stream, grpc::ClientContext* give_up) {
    std::int64_t sequence = pick(-1000, 1000);
    v1::SessionResponse response;
    for (int round = pick(1, 8); round > 0; --round) {
      for (int i = pick(1, 12); i > 0; --i) {
        v1::SessionRequest request;
        *request.mutable_update() = new_update(sequence += pick(1, 3));
        const bool malformed = chance(0.03);
        if (malformed) request.mutable_update()->mutable_problem()->add_gradient(0.0);
        sent_.push_back({request.update(), malformed});
        if (!stream.Write(request)) return;
      }
      if (give_up != nullptr && round == 1) return give_up->TryCancel();
      while (waits() && stream.Read(&response)) take(response);
      if (chance(0.3)) dawdle(30);
    }
  }

  [[nodiscard]] v1::SessionUpdate new_update(std::int64_t sequence) {
    v1::SessionUpdate update;
    update.set_sequence(sequence);
    if (chance(0.8)) {
      for (const double g : problem_.gradient())
        update.mutable_problem()->add_gradient(g * (1.0 + 0.02 * std::normal_distribution()(random())));
    }
    if (chance(0.2)) update.mutable_problem()->set_constant(pick(-5, 5));
    if (chance(0.1)) update.set_cold(true);
    if (chance(0.1)) update.set_deadline_s(1e-5 * pick(1, 1000));
    if (chance(0.3)) {
      v1::ShiftBlock* block = update.mutable_shift()->add_variables();
      block->set_count(problem_.gradient_size());
      block->set_by(examples::kHopperVariables);
    }
    return update;
  }

  void take(const v1::SessionResponse& response) {
    switch (response.event_case()) {
      case v1::SessionResponse::kProgress:
        return expect(is_oldest(response.progress().sequence()), "progress of another update");
      case v1::SessionResponse::kAnswer:
        expect(is_oldest(response.answer().sequence()), "an answer out of order");
        if (end(response.answer().sequence(), true) == nullptr) return;
        bring_up_to_date(response.answer().sequence());
        return answered(problem_, response.answer().solution());
      case v1::SessionResponse::kSuperseded:
        expect(latest_only_, "superseded without latest_only");
        end(response.superseded().sequence(), true);
        return count("superseded");
      case v1::SessionResponse::kError:
        return take(response.error());
      default:
        return fault("a strange event");
    }
  }

  void take(const v1::SessionError& error) {
    // One that is refused is reported at once, and has changed nothing; one that is late has.
    const bool late = error.status().code() == Code::DEADLINE_EXCEEDED;
    expect(!late || is_oldest(error.sequence()), "late out of order");
    const Sent* sent = end(error.sequence(), late);
    if (sent == nullptr) return;
    if (sent->malformed) {
      ended(error.status(), "malformed update", {Code::INVALID_ARGUMENT});
    } else if (sent->update.deadline_s() > 0.0) {
      ended(error.status(), "late update", {Code::DEADLINE_EXCEEDED});
    } else {
      ended(error.status(), "update");
    }
  }

  [[nodiscard]] bool waits() const {
    return std::any_of(sent_.begin(), sent_.end(), [](const Sent& sent) { return !sent.over; });
  }

  // The oldest without an outcome.
  [[nodiscard]] bool is_oldest(std::int64_t sequence) const {
    const auto oldest = std::find_if(sent_.begin(), sent_.end(), [](const Sent& sent) { return !sent.over; });
    return oldest != sent_.end() && oldest->update.sequence() == sequence;
  }

  // The one outcome of an update; null if it was never sent, or has had one.
  const Sent* end(std::int64_t sequence, bool counts) {
    const auto sent = std::find_if(sent_.begin(), sent_.end(),
                                   [&](const Sent& one) { return one.update.sequence() == sequence; });
    if (sent == sent_.end() || sent->over) {
      fault("an outcome twice, or of no update");
      return nullptr;
    }
    sent->over = true;
    sent->counts = counts;
    return &*sent;
  }

  // The problem as it is with all updates up to this one, which then need not be remembered.
  void bring_up_to_date(std::int64_t sequence) {
    for (; !sent_.empty() && sent_.front().update.sequence() <= sequence; sent_.pop_front()) {
      if (!sent_.front().counts) continue;
      const v1::ProblemUpdate& numbers = sent_.front().update.problem();
      if (!numbers.gradient().empty()) *problem_.mutable_gradient() = numbers.gradient();
      if (numbers.has_constant()) problem_.set_constant(numbers.constant());
    }
  }

  v1::Problem problem_;
  bool latest_only_ = false;
  std::deque<Sent> sent_;  // oldest first
};

// Set up and left alone until the server ends it; or not even set up.
class IdleSession final : public Client {
 public:
  IdleSession(Environment& environment, std::uint64_t seed) : Client(environment, "idle sessions", seed) {}

 private:
  void episode() override {
    const auto context = new_context();
    const auto stream = solver().Session(context.get());
    if (chance(0.7)) {
      v1::SessionRequest request;
      *request.mutable_setup()->mutable_problem() = small_problems()[1].problem();
      stream->Write(request);
    }
    for (v1::SessionResponse response; stream->Read(&response);) count("events");
    ended(stream->Finish(), "idle session", {Code::ABORTED});
  }
};

}  // namespace

std::unique_ptr<Client> make_session_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<SessionClient>(environment, seed);
}

std::unique_ptr<Client> make_idle_session(Environment& environment, std::uint64_t seed) {
  return std::make_unique<IdleSession>(environment, seed);
}

}  // namespace marble::testing
