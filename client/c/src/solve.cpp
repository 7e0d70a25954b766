#include <cmath>
#include <iterator>
#include <optional>

#include "handles.h"

using marble::Expected;
using marble::unexpected;
using marble::c::guarded;
using marble::c::in_use;
using marble::c::none_lent;
using marble::c::null;

namespace marble::c {

Expected<Client> connect(const char* address, const Keepalive& keepalive) {
  ConnectOptions options = ConnectOptions::from_environment();
  options.keepalive = keepalive;
  if (address != nullptr) return Client::connect(address, options);
  const char* const named = std::getenv("MARBLE_SERVER");
  return named != nullptr && *named != '\0' ? Client::connect(named, options) : Client::in_process();
}

namespace {

std::int32_t connected(const char* address, const Keepalive& keepalive, marble_client** client,
                       marble_error* error) {
  if (client != nullptr) *client = nullptr;
  return guarded(error, [&]() -> Expected<void> {
    if (client == nullptr) return unexpected(null("client"));
    MARBLE_ASSIGN_OR_RETURN(auto made, connect(address, keepalive));
    *client = new marble_client{std::move(made)};
    return {};
  });
}

double conflict_kind(const Solution& s) {
  if (!s.conflict) return 0.0;
  return s.conflict->minimal ? 2.0 : 1.0;
}

template <class Value>
double number(const Value& value) {
  return static_cast<double>(value);
}
template <class Value>
double number(const std::optional<Value>& value) {
  return value ? number(*value) : std::nan("");
}

using S = RemoteSolution;
struct Number {
  const char* name;
  double (*of)(const S& solution);
};
constexpr Number kNumbers[] = {
#define MARBLE_SOLUTION_NUMBER(name) {#name, [](const S& s) { return number(s.name); }},
#define MARBLE_SOLUTION_OPTIONAL(name) {#name, [](const S& s) { return number(s.name); }},
#define MARBLE_SOLUTION_ENUM(name) {#name, [](const S& s) { return number(s.name); }},
#include "marble/solution.def"
    {"equality_violation", [](const S& s) { return s.violations.equality; }},
    {"inequality_violation", [](const S& s) { return s.violations.inequality; }},
    {"complementarity_violation", [](const S& s) { return s.violations.complementarity; }},
    {"reopened", [](const S& s) { return number(s.reopened); }},
    {"conflict", [](const S& s) { return conflict_kind(s); }},
    {"setup_s", [](const S& s) { return s.times.setup_s; }},
    {"solve_s", [](const S& s) { return s.times.solve_s; }},
    {"queue_s", [](const S& s) { return s.queue_s; }},
    {"total_s", [](const S& s) { return s.total_s; }},
};

}  // namespace
}  // namespace marble::c

std::int32_t marble_client_connect(const char* address, marble_client** client, marble_error* error) {
  return marble::c::connected(address, {}, client, error);
}

std::int32_t marble_client_connect_for_control(const char* address, marble_client** client,
                                               marble_error* error) {
  return marble::c::connected(address, marble::Keepalive::control_loop(), client, error);
}

void marble_client_destroy(marble_client* client) { delete client; }

const char* marble_client_address(const marble_client* client) {
  return client == nullptr ? "" : client->client.address().c_str();
}

std::int32_t marble_solve(const marble_client* client, const marble_problem* problem,
                          const marble_options* options, marble_call* call, marble_solution** solution,
                          marble_error* error) {
  if (solution != nullptr) *solution = nullptr;
  return guarded(error, [&]() -> Expected<void> {
    if (problem == nullptr) return unexpected(null("problem"));
    if (solution == nullptr) return unexpected(null("solution"));
    const marble_call none;
    const marble_call& given = call == nullptr ? none : *call;
    const std::shared_lock reading(problem->usage, std::try_to_lock);
    if (!reading) return unexpected(in_use("problem"));
    const std::shared_lock reading_call(given.usage, std::try_to_lock);
    if (!reading_call) return unexpected(in_use("call"));
    Reporter reporter(given.function, given.user, given.stop.source());
    marble::SensitivityRequest wanted;
    const marble::SolveControls controls = given.controls(&reporter, wanted);
    const marble::CallControls over = given.over(problem->problem.name);
    const marble::Options chosen = options == nullptr ? marble::Options() : options->options;
    const auto view = problem->problem.view();
    MARBLE_ASSIGN_OR_RETURN(auto answer, client == nullptr
                                             ? marble::solve(view, chosen, controls, over)
                                             : client->client.solve(view, chosen, controls, over));
    *solution = new marble_solution{std::move(answer)};
    return {};
  });
}

void marble_solution_destroy(marble_solution* solution) { delete solution; }

std::int32_t marble_solution_status(const marble_solution* solution) {
  return solution == nullptr ? -1 : static_cast<std::int32_t>(solution->solution.status);
}

const char* marble_solution_detail(const marble_solution* solution) {
  return solution == nullptr ? "" : solution->solution.detail.c_str();
}

double marble_solution_objective(const marble_solution* solution) {
  return solution == nullptr ? std::nan("") : solution->solution.objective;
}

std::int32_t marble_solution_vector(const marble_solution* solution, const char* name, const double** values,
                                    std::int64_t* count, marble_error* error) {
  none_lent(values, count);
  return guarded(error, [&]() -> Expected<void> {
    if (solution == nullptr) return unexpected(null("solution"));
    if (name == nullptr) return unexpected(null("name"));
    if (values == nullptr) return unexpected(null("values"));
    if (count == nullptr) return unexpected(null("count"));
    const marble::Solution& s = solution->solution;
#define MARBLE_SOLUTION_VECTOR(member, field, letter)    \
  if (std::string_view(name) == #letter) {               \
    *values = s.member.data();                           \
    *count = static_cast<std::int64_t>(s.member.size()); \
    return {};                                           \
  }
#include "marble/solution.def"
    return unexpected(marble::invalid("name", name, "must be z, y, nu, xi, eta or certificate"));
  });
}

std::int32_t marble_solution_number(const marble_solution* solution, const char* name, double* value,
                                    marble_error* error) {
  return guarded(error, [&]() -> Expected<void> {
    if (solution == nullptr) return unexpected(null("solution"));
    if (name == nullptr) return unexpected(null("name"));
    if (value == nullptr) return unexpected(null("value"));
    for (const auto& [key, of] : marble::c::kNumbers) {
      if (std::string_view(name) != key) continue;
      *value = of(solution->solution);
      return {};
    }
    return unexpected(marble::invalid("name", name, "is no number of a solution"));
  });
}

const char* marble_solution_number_name(std::int32_t index) {
  const bool is_one = index >= 0 && static_cast<std::size_t>(index) < std::size(marble::c::kNumbers);
  return is_one ? marble::c::kNumbers[index].name : "";
}

std::int32_t marble_solution_conflict(const marble_solution* solution, const char* part,
                                      const std::int32_t** indices, std::int64_t* count,
                                      marble_error* error) {
  none_lent(indices, count);
  return guarded(error, [&]() -> Expected<void> {
    if (solution == nullptr) return unexpected(null("solution"));
    if (part == nullptr) return unexpected(null("part"));
    if (indices == nullptr) return unexpected(null("indices"));
    if (count == nullptr) return unexpected(null("count"));
    if (!solution->solution.conflict) {
      const char* const why =
          "has no conflict: option explain was not set, or no proof of infeasibility found";
      return unexpected(marble::failure(marble::ErrorCode::failed_precondition, "solution", why));
    }
    const marble::Conflict& c = *solution->solution.conflict;
    const std::pair<const char*, const std::vector<marble::Index>*> all[] = {
        {"equalities", &c.equalities},
        {"inequalities", &c.inequalities},
        {"left_sides", &c.left_sides},
        {"right_sides", &c.right_sides},
        {"complementarities", &c.complementarities}};
    for (const auto& [key, rows] : all) {
      if (std::string_view(part) != key) continue;
      *indices = rows->data();
      *count = static_cast<std::int64_t>(rows->size());
      return {};
    }
    const char* const parts =
        "must be equalities, inequalities, left_sides, right_sides or complementarities";
    return unexpected(marble::invalid("part", part, parts));
  });
}

const char* marble_solution_conflict_detail(const marble_solution* solution) {
  const bool has = solution != nullptr && solution->solution.conflict.has_value();
  return has ? solution->solution.conflict->detail.c_str() : "";
}
