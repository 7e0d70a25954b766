// What tests of sessions over a real connection have in common.
#pragma once

#include <memory>
#include <optional>

#include "bidi.h"
#include "marble/convert.h"
#include "marble/examples.h"
#include "service_test.h"

namespace marble::testing {

using Call = Bidi<v1::SessionRequest, v1::SessionResponse>;
using SessionEvent = v1::SessionResponse;

class Session : public ServiceTest {
 protected:
  std::unique_ptr<Call> open() {
    return std::make_unique<Call>([this](grpc::ClientContext* context) { return solver().Session(context); });
  }
  static v1::SessionRequest setup_of(const v1::SolveRequest& solve) {
    v1::SessionRequest request;
    *request.mutable_setup()->mutable_problem() = solve.problem();
    *request.mutable_setup()->mutable_options() = solve.options();
    return request;
  }
  static v1::SessionRequest setup_of(const OwnedProblem& problem) {
    v1::SessionRequest request;
    to_message(problem.view(), request.mutable_setup()->mutable_problem());
    return request;
  }
  static v1::SessionRequest update(std::int64_t sequence) {
    v1::SessionRequest request;
    request.mutable_update()->set_sequence(sequence);
    return request;
  }
  /// Sets up and waits until it is ready.
  std::unique_ptr<Call> set_up(const v1::SessionRequest& setup) {
    auto call = open();
    EXPECT_TRUE(call->write(setup));
    const auto ready = call->next();
    EXPECT_TRUE(ready && ready->has_ready());
    return call;
  }
  static std::optional<SessionEvent> ask(Call& call, const v1::SessionRequest& request) {
    EXPECT_TRUE(call.write(request));
    return call.next();
  }
  /// A long solve that steps aside for no session.
  static v1::SolveRequest blocking_request() {
    v1::SolveRequest request = long_request();
    request.set_priority(v1::PRIORITY_REALTIME);
    return request;
  }
  [[nodiscard]] bool eventually_no_session() {
    return eventually([&] { return counters().sessions() == 0; });
  }
};

}  // namespace marble::testing
