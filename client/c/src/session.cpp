#include "handles.h"

using marble::Expected;
using marble::unexpected;
using marble::c::change;
using marble::c::guarded;
using marble::c::in_use;
using marble::c::null;

struct marble_session {
  marble::Session session;
  marble::PartSizes sizes;
  marble::OwnedProblem shape;  // its vectors alone: a shift by stages needs them
  marble_call* call;
  // Changes for the next solve.
  marble::OwnedProblem numbers = {};
  std::optional<double> c0 = {};
  std::optional<marble::Options> options = {};
  std::vector<double> initial_z = {};
  bool cold = false;
  marble::Shift shift = {};
  marble::c::Usage usage = {};

  void forget() {
    numbers = {};
    c0 = {};
    options = {};
    initial_z.clear();
    cold = false;
    shift = {};
  }
};

std::int32_t marble_session_open(const marble_client* client, const marble_problem* problem,
                                 const marble_options* options, marble_call* call, marble_session** session,
                                 marble_error* error) {
  if (session != nullptr) *session = nullptr;
  return guarded(error, [&]() -> Expected<void> {
    if (problem == nullptr) return unexpected(null("problem"));
    if (session == nullptr) return unexpected(null("session"));
    const marble_call none;
    const std::shared_lock reading(problem->usage, std::try_to_lock);
    if (!reading) return unexpected(in_use("problem"));
    const std::shared_lock reading_call((call == nullptr ? none : *call).usage, std::try_to_lock);
    if (!reading_call) return unexpected(in_use("call"));
    MARBLE_ASSIGN_OR_RETURN(const auto checked, marble::Problem::create(problem->problem.view()));
    marble::SessionOptions over;
    over.problem_name = problem->problem.name;
    if (call != nullptr) {
      over.progress = call->function != nullptr;
      over.initial_z = call->initial_z;
      over.stop = call->stop.source().get_token();
      over.request_id = call->request_id;
      over.priority = call->priority;
      over.reopen = call->reopen_s > 0.0;
      over.reopen_wait = std::chrono::duration<double>(call->reopen_s);
      over.answer_grace = std::chrono::duration<double>(call->answer_grace_s);
    }
    return marble::c::with_client(client, [&](const marble::Client& where) -> Expected<void> {
      MARBLE_ASSIGN_OR_RETURN(
          auto opened, where.open_session(problem->problem.view(),
                                          options == nullptr ? marble::Options() : options->options, over));
      marble::OwnedProblem shape;
      shape.g = problem->problem.g;
      shape.b = problem->problem.b;
      shape.d = problem->problem.d;
      shape.l = problem->problem.l;
      shape.r = problem->problem.r;
      *session =
          new marble_session{std::move(opened), marble::PartSizes::of(checked), std::move(shape), call};
      return {};
    });
  });
}

void marble_session_destroy(marble_session* session) { delete session; }

std::int32_t marble_session_set(marble_session* session, const char* part, const double* values,
                                std::int64_t count, marble_error* error) {
  return change(session, "session", error, [&]() -> Expected<void> {
    if (part == nullptr) return unexpected(null("part"));
    MARBLE_ASSIGN_OR_RETURN(const auto given, marble::c::numbers(values, count));
    const std::string name = part;
    marble::ProblemUpdate update;
    if (name == "c0") {
      if (count != 1) return unexpected(marble::invalid("c0", std::to_string(count), "must be 1 number"));
      update.c0 = *values;
      MARBLE_RETURN_IF_ERROR(session->sizes.check(update));
      session->c0 = *values;
      return {};
    }
    // Empty arrays can only have a wrong count, and an update without them would be empty.
    const auto wrong_count = [&](std::size_t wanted) {
      return marble::invalid(name, std::to_string(count), "must have " + std::to_string(wanted) + " numbers");
    };
#define MARBLE_VECTOR(letter, field)                                                                  \
  if (name == #letter) {                                                                              \
    if (given.size() != session->sizes.letter) return unexpected(wrong_count(session->sizes.letter)); \
    update.letter = given;                                                                            \
    MARBLE_RETURN_IF_ERROR(session->sizes.check(update));                                             \
    session->numbers.letter.assign(given.begin(), given.end());                                       \
    return {};                                                                                        \
  }
#define MARBLE_MATRIX(letter, field, update_field, vector)                                            \
  if (name == #letter) {                                                                              \
    if (given.size() != session->sizes.letter) return unexpected(wrong_count(session->sizes.letter)); \
    update.letter = given;                                                                            \
    MARBLE_RETURN_IF_ERROR(session->sizes.check(update));                                             \
    session->numbers.letter.values.assign(given.begin(), given.end());                                \
    return {};                                                                                        \
  }
#include "marble/contract.def"
    return unexpected(marble::invalid("part", name, "must be c0, g, b, d, l, r, Q, A, C, L or R"));
  });
}

std::int32_t marble_session_set_options(marble_session* session, const marble_options* options,
                                        marble_error* error) {
  return change(session, "session", error, [&]() -> Expected<void> {
    if (options == nullptr) return unexpected(null("options"));
    session->options = options->options;
    return {};
  });
}

std::int32_t marble_session_set_initial_z(marble_session* session, const double* z, std::int64_t count,
                                          marble_error* error) {
  return change(session, "session", error, [&]() -> Expected<void> {
    const auto given = marble::c::numbers(z, count);
    if (!given) return unexpected(marble::of_field("initial_z", given.error()));
    const auto variables = static_cast<marble::Index>(session->sizes.g);
    MARBLE_RETURN_IF_ERROR(marble::Problem::check_initial_point(*given, variables));
    session->initial_z.assign(given->begin(), given->end());
    return {};
  });
}

std::int32_t marble_session_set_cold(marble_session* session, marble_error* error) {
  return change(session, "session", error, [&]() -> Expected<void> {
    session->cold = true;
    return {};
  });
}

std::int32_t marble_session_shift(marble_session* session, std::int32_t stages, marble_error* error) {
  return change(session, "session", error, [&]() -> Expected<void> {
    MARBLE_ASSIGN_OR_RETURN(session->shift, marble::Shift::by_stage(session->shape.view(), stages));
    return {};
  });
}

std::int32_t marble_session_solve(marble_session* session, marble_solution** solution, marble_error* error) {
  if (solution != nullptr) *solution = nullptr;
  return change(session, "session", error, [&]() -> Expected<void> {
    if (solution == nullptr) return unexpected(null("solution"));
    const marble_call none;
    const marble_call& call = session->call == nullptr ? none : *session->call;
    const std::shared_lock reading_call(call.usage, std::try_to_lock);
    if (!reading_call) return unexpected(in_use("call"));
    Reporter reporter(call.function, call.user, call.stop.source());
    marble::ProblemUpdate update;
    update.c0 = session->c0;
#define MARBLE_VECTOR(letter, field) update.letter = session->numbers.letter;
#define MARBLE_MATRIX(letter, field, update_field, vector) update.letter = session->numbers.letter.values;
#include "marble/contract.def"
    marble::UpdateControls controls;
    controls.options = session->options;
    controls.initial_z = session->initial_z;
    controls.cold = session->cold;
    controls.shift = session->shift;
    controls.deadline = call.deadline();
    controls.progress = call.function == nullptr ? nullptr : &reporter;
    const marble::SensitivityRequest wanted = call.derivatives.view();
    if (call.wants_derivatives()) controls.sensitivity = &wanted;
    auto answer = session->session.solve(update, controls);
    session->forget();
    if (!answer) return unexpected(answer.error());
    *solution = new marble_solution{std::move(*answer)};
    return {};
  });
}
