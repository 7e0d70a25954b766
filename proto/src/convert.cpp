#include "marble/convert.h"

#include <cmath>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace marble {
namespace {

template <class Field>
auto span_of(const Field& field) {
  return std::span(field.data(), static_cast<std::size_t>(field.size()));
}

template <class Field, class Values>
void assign(Field* field, const Values& values) {
  field->Assign(values.begin(), values.end());
}

std::vector<double> vector_of(const google::protobuf::RepeatedField<double>& field) {
  return {field.begin(), field.end()};
}

// The core uses the letters of the equation, the message the terms of the field.
struct FieldNames {
  const char *core, *message;
};
constexpr FieldNames kFieldNames[] = {
    {"c0", "constant"},
#define MARBLE_VECTOR(letter, field) {#letter, #field},
#define MARBLE_MATRIX(letter, field, update, vector) {#letter, #field},
#include "marble/contract.def"
};
constexpr FieldNames kUpdateNames[] = {
#define MARBLE_MATRIX(letter, field, update, vector) {#letter ".values", #update},
#include "marble/contract.def"
};

// Fields of a starting point.
constexpr FieldNames kStartNames[] = {
    {"initial_z", "initial_point.z"},
    {"warm_start.complementarity_multipliers_L", "warm_start.complementarity_multipliers_l"},
    {"warm_start.complementarity_multipliers_R", "warm_start.complementarity_multipliers_r"},
};

// An option in a message, read and set by its generated accessors: reflection takes a hundred times as long.
// Options that the message does not have are left alone.
#define MARBLE_OPTION(type, member, default_value, low, high, unit, doc)                 \
  template <class Message>                                                               \
  void take_##member(const Message& message, Options& options) {                         \
    if constexpr (requires { message.has_##member(); }) {                                \
      if (!message.has_##member()) return;                                               \
      if constexpr (std::is_enum_v<type>) { /* UNSPECIFIED counts as absent */           \
        const auto number = static_cast<unsigned>(message.member());                     \
        if (number != 0) options.member = static_cast<type>(number - 1U);                \
      } else {                                                                           \
        options.member = message.member();                                               \
      }                                                                                  \
    }                                                                                    \
  }                                                                                      \
  template <class Message>                                                               \
  void put_##member(const Options& options, Message* message) {                          \
    if constexpr (requires { message->clear_##member(); }) {                             \
      if constexpr (std::is_enum_v<type>) {                                              \
        using Value = decltype(message->member());                                       \
        message->set_##member(static_cast<Value>(static_cast<int>(options.member) + 1)); \
      } else {                                                                           \
        message->set_##member(options.member);                                           \
      }                                                                                  \
    }                                                                                    \
  }
#include "marble/options.def"
#undef MARBLE_OPTION

}  // namespace

SparseMatrixView view_of(const v1::SparseMatrix& m) {
  return {m.rows(), m.columns(), span_of(m.column_pointers()), span_of(m.row_indices()), span_of(m.values())};
}

void to_message(const SparseMatrixView& matrix, v1::SparseMatrix* message) {
  message->set_rows(matrix.rows);
  message->set_columns(matrix.columns);
  assign(message->mutable_column_pointers(), matrix.column_pointers);
  assign(message->mutable_row_indices(), matrix.row_indices);
  assign(message->mutable_values(), matrix.values);
}

ProblemView view_of(const v1::Problem& m) {
  ProblemView view;
  view.hessian_form =
      m.hessian_form() == v1::HESSIAN_FORM_UPPER_TRIANGLE ? HessianForm::upper_triangle : HessianForm::full;
  view.c0 = m.constant();
#define MARBLE_VECTOR(letter, field) view.letter = span_of(m.field());
#define MARBLE_MATRIX(letter, field, update, vector) \
  if (m.has_##field()) view.letter = view_of(m.field());
#include "marble/contract.def"
  return view;
}

ProblemUpdate update_of(const v1::ProblemUpdate& m) {
  ProblemUpdate update;
  if (m.has_constant()) update.c0 = m.constant();
#define MARBLE_VECTOR(letter, field) update.letter = span_of(m.field());
#define MARBLE_MATRIX(letter, field, values, vector) update.letter = span_of(m.values());
#include "marble/contract.def"
  return update;
}

void to_message(const ProblemUpdate& update, v1::ProblemUpdate* message) {
  if (update.c0) message->set_constant(*update.c0);
#define MARBLE_VECTOR(letter, field) assign(message->mutable_##field(), update.letter);
#define MARBLE_MATRIX(letter, field, values, vector) assign(message->mutable_##values(), update.letter);
#include "marble/contract.def"
}

void to_message(const ProblemView& problem, v1::Problem* message) {
  message->set_hessian_form(problem.hessian_form == HessianForm::full ? v1::HESSIAN_FORM_FULL
                                                                      : v1::HESSIAN_FORM_UPPER_TRIANGLE);
  message->set_constant(problem.c0);
#define MARBLE_VECTOR(letter, field) assign(message->mutable_##field(), problem.letter);
#define MARBLE_MATRIX(letter, field, update, vector) to_message(problem.letter, message->mutable_##field());
#include "marble/contract.def"
}

std::string message_field(const std::string& field) {
  for (const auto& [core, message] : kStartNames) {
    if (field == core) return message;
  }
  const std::size_t dot = field.find('.');
  const std::string head = field.substr(0, dot);
  for (const auto& [core, message] : kFieldNames) {
    if (head == core) return dot == std::string::npos ? message : message + field.substr(dot);
  }
  return field;
}

std::string update_field(const std::string& field) {
  for (const auto& [core, message] : kUpdateNames) {
    if (field == core) return message;
  }
  return message_field(field);
}

std::string core_field(const std::string& field) {
  constexpr std::string_view kSensitivity = "sensitivity.";
  if (field.starts_with(kSensitivity))
    return std::string(kSensitivity) + core_sensitivity_field(field.substr(kSensitivity.size()));
  const std::size_t dot = field.find('.');
  const std::string head = field.substr(0, dot);
  for (const auto& [core, message] : kUpdateNames) {
    if (field == message) return core;
  }
  for (const auto& [core, message] : kStartNames) {
    if (field == message) return core;
  }
  for (const auto& [core, message] : kFieldNames) {
    if (head == message) return dot == std::string::npos ? core : core + field.substr(dot);
  }
  return field;
}

int to_message(ErrorCode code) {
  switch (code) {
#define MARBLE_ERROR(name, code, ...) \
  case ErrorCode::name:               \
    return code;
#include "marble/contract.def"
  }
  return 2;  // UNKNOWN
}

ErrorCode error_code_of(int code) {
  switch (code) {
#define MARBLE_ERROR(name, code, ...) \
  case code:                          \
    return ErrorCode::name;
#define MARBLE_FOREIGN_CODE(code, name) \
  case code:                            \
    return ErrorCode::name;
#include "marble/contract.def"
    default:
      return ErrorCode::internal;
  }
}

Expected<Options> options_of(const v1::SolveOptions& message, const Options& defaults) {
  Options options = defaults;
#define MARBLE_OPTION(type, member, default_value, low, high, unit, doc) take_##member(message, options);
#include "marble/options.def"
#undef MARBLE_OPTION
  MARBLE_RETURN_IF_ERROR(validate_ranges(options));
  return options;
}

void to_message(const Options& options, v1::SolveOptions* message) {
#define MARBLE_OPTION(type, member, default_value, low, high, unit, doc) put_##member(options, message);
#include "marble/options.def"
#undef MARBLE_OPTION
}

void to_message(const OptionInfo& option, v1::OptionSchema* message) {
  message->set_name(std::string(option.name));
  switch (option.type) {
    case OptionType::real:
      message->set_type(v1::OptionSchema::TYPE_REAL);
      break;
    case OptionType::integer:
      message->set_type(v1::OptionSchema::TYPE_INTEGER);
      break;
    case OptionType::boolean:
      message->set_type(v1::OptionSchema::TYPE_BOOLEAN);
      break;
    case OptionType::choice:
      message->set_type(v1::OptionSchema::TYPE_CHOICE);
      break;
  }
  message->set_default_value(option.default_value);
  message->set_low(option.low);
  message->set_high(option.high);
  message->set_unit(std::string(option.unit));
  message->set_doc(std::string(option.doc));
  for (const std::string_view choice : option.choices) message->add_choices(std::string(choice));
}

void to_message(const Violations& violations, v1::Violations* message) {
  message->set_equality(violations.equality);
  message->set_inequality(violations.inequality);
  message->set_complementarity(violations.complementarity);
}

Violations violations_of(const v1::Violations& message) {
  return {message.equality(), message.inequality(), message.complementarity()};
}

void to_message(const Activity& activity, v1::Activity* message) {
  message->set_phase(static_cast<v1::Phase>(static_cast<int>(activity.phase) + v1::PHASE_SETUP));
  message->set_done(activity.done);
  message->set_total(activity.total);
  if (std::isfinite(activity.incumbent)) message->set_incumbent(activity.incumbent);
  if (std::isfinite(activity.gap)) message->set_gap(activity.gap);
  message->set_text(describe(activity));
}

Activity activity_of(const v1::Activity& message) {
  Activity activity;
  if (v1::Phase_IsValid(message.phase()) && message.phase() != v1::PHASE_UNSPECIFIED)
    activity.phase = static_cast<Phase>(static_cast<int>(message.phase()) - v1::PHASE_SETUP);
  activity.done = message.done();
  activity.total = message.total();
  if (message.has_incumbent()) activity.incumbent = message.incumbent();
  if (message.has_gap()) activity.gap = message.gap();
  return activity;
}

void to_message(const Progress& progress, v1::Progress* message) {
  message->set_iteration(progress.iteration);
  message->set_outer_iteration(progress.outer_iteration);
  message->set_objective(progress.objective);
  to_message(progress.violations, message->mutable_violations());
  message->set_kkt_residual(progress.kkt_residual);
  message->set_kappa(progress.kappa);
  message->set_rho(progress.rho);
  message->set_step_length(progress.step_length);
  message->set_regularization(progress.regularization);
  message->set_factorizations(progress.factorizations);
  message->set_elapsed_s(progress.elapsed_s);
  message->set_stage(progress.stage);
  message->set_scenarios(progress.scenarios);
  tree_to_message(progress, message);
}

Progress progress_of(const v1::Progress& message) {
  Progress progress;
  progress.iteration = message.iteration();
  progress.outer_iteration = message.outer_iteration();
  progress.objective = message.objective();
  progress.violations = violations_of(message.violations());
  progress.kkt_residual = message.kkt_residual();
  progress.kappa = message.kappa();
  progress.rho = message.rho();
  progress.step_length = message.step_length();
  progress.regularization = message.regularization();
  progress.factorizations = message.factorizations();
  progress.elapsed_s = message.elapsed_s();
  progress.stage = message.stage();
  progress.scenarios = message.scenarios();
  take_tree(message, progress);
  progress.z = span_of(message.z());
  return progress;
}

v1::Status to_message(Status status) { return static_cast<v1::Status>(static_cast<int>(status) + 1); }

Status status_of(v1::Status status) {
  const int number = static_cast<int>(status) - 1;
  const bool known = number >= 0 && number <= static_cast<int>(Status::numerical_failure);
  return known ? static_cast<Status>(number) : Status::numerical_failure;
}

static_assert(static_cast<int>(Stationarity::strong) == v1::STATIONARITY_STRONG, "the enums count alike");
static_assert(static_cast<int>(SecondOrder::convex) == v1::SECOND_ORDER_CONVEX, "the enums count alike");
static_assert(static_cast<int>(Status::solved) + 1 == v1::STATUS_SOLVED &&
                  static_cast<int>(Status::numerical_failure) + 1 == v1::STATUS_NUMERICAL_FAILURE,
              "both enumerations list the statuses in the same order");

void to_message(const Conflict& conflict, v1::Conflict* message) {
  assign(message->mutable_equalities(), conflict.equalities);
  assign(message->mutable_inequalities(), conflict.inequalities);
  assign(message->mutable_left_sides(), conflict.left_sides);
  assign(message->mutable_right_sides(), conflict.right_sides);
  assign(message->mutable_complementarities(), conflict.complementarities);
  message->set_minimal(conflict.minimal);
  message->set_detail(conflict.detail);
  message->set_linear_programs(conflict.linear_programs);
  message->set_factorizations(conflict.factorizations);
}

Conflict conflict_of(const v1::Conflict& message) {
  const auto indices = [](const auto& field) { return std::vector<Index>(field.begin(), field.end()); };
  return {.equalities = indices(message.equalities()),
          .inequalities = indices(message.inequalities()),
          .left_sides = indices(message.left_sides()),
          .right_sides = indices(message.right_sides()),
          .complementarities = indices(message.complementarities()),
          .minimal = message.minimal(),
          .detail = message.detail(),
          .linear_programs = message.linear_programs(),
          .factorizations = message.factorizations()};
}

namespace {

// The kinds of solution.def: enumerations and parts, and values that may be absent.
v1::PointOrigin to_message(PointOrigin origin) {
  return origin == PointOrigin::previous ? v1::POINT_ORIGIN_PREVIOUS : v1::POINT_ORIGIN_SOLVE;
}
v1::Stationarity to_message(Stationarity kind) {
  return static_cast<v1::Stationarity>(static_cast<int>(kind));
}
v1::SecondOrder to_message(SecondOrder kind) { return static_cast<v1::SecondOrder>(static_cast<int>(kind)); }

void to_message(const Times& times, v1::Times* message) {
  message->set_setup_s(times.setup_s);
  message->set_factorization_s(times.factorization_s);
  message->set_line_search_s(times.line_search_s);
  message->set_solve_s(times.solve_s);
  message->set_polish_s(times.polish_s);
  message->set_tree_s(times.tree_s);
}

void read(v1::Status sent, Status& status) { status = status_of(sent); }
void read(v1::PointOrigin sent, PointOrigin& origin) {
  origin = sent == v1::POINT_ORIGIN_PREVIOUS ? PointOrigin::previous : PointOrigin::solve;
}
void read(v1::Stationarity sent, Stationarity& kind) {
  if (v1::Stationarity_IsValid(sent)) kind = static_cast<Stationarity>(static_cast<int>(sent));
}
void read(v1::SecondOrder sent, SecondOrder& kind) {
  if (v1::SecondOrder_IsValid(sent)) kind = static_cast<SecondOrder>(static_cast<int>(sent));
}
void read(const v1::Violations& sent, Violations& violations) { violations = violations_of(sent); }
void read(const v1::Times& sent, Times& times) {
  times = {sent.setup_s(), sent.factorization_s(), sent.line_search_s(),
           sent.solve_s(), sent.polish_s(),        sent.tree_s()};
}
void read(const v1::Sensitivity& sent, std::optional<Expected<SensitivityAnswer>>& sensitivity) {
  sensitivity = sensitivity_of(sent);
}
void read(const v1::Conflict& sent, std::optional<Conflict>& conflict) { conflict = conflict_of(sent); }

template <class Value>
const Value* if_known(const Value& value) {
  return &value;
}
template <class Value>
const Value* if_known(const std::optional<Value>& value) {
  return value ? &*value : nullptr;
}

}  // namespace

void to_message(const Solution& solution, v1::Solution* message) {
  static const auto& unknown = *new Solution;
#define MARBLE_SOLUTION_NUMBER(name) message->set_##name(solution.name);
#define MARBLE_SOLUTION_OPTIONAL(name) \
  if (solution.name != unknown.name) message->set_##name(*if_known(solution.name));
#define MARBLE_SOLUTION_TEXT(name) message->set_##name(solution.name);
#define MARBLE_SOLUTION_VECTOR(name, field, letter) assign(message->mutable_##field(), solution.name);
#define MARBLE_SOLUTION_ENUM(name) message->set_##name(to_message(solution.name));
#define MARBLE_SOLUTION_PART(name) \
  if (const auto* part = if_known(solution.name)) to_message(*part, message->mutable_##name());
#include "marble/solution.def"
}

Solution solution_of(const v1::Solution& message) {
  Solution solution;
#define MARBLE_SOLUTION_NUMBER(name) solution.name = message.name();
#define MARBLE_SOLUTION_OPTIONAL(name) \
  if (message.has_##name()) solution.name = message.name();
#define MARBLE_SOLUTION_TEXT(name) solution.name = message.name();
#define MARBLE_SOLUTION_VECTOR(name, field, letter) solution.name = vector_of(message.field());
#define MARBLE_SOLUTION_ENUM(name) read(message.name(), solution.name);
#define MARBLE_SOLUTION_PART(name) \
  if (message.has_##name()) read(message.name(), solution.name);
#include "marble/solution.def"
  return solution;
}

void to_message(const Solution& start, v1::WarmStart* message) {
#define MARBLE_POINT(letter, member, field) assign(message->mutable_##field(), start.member);
#include "marble/contract.def"
  message->set_reference_objective(start.reference_objective);
}

Solution solution_of(const v1::WarmStart& message) {
  Solution start;
#define MARBLE_POINT(letter, member, field) start.member = vector_of(message.field());
#include "marble/contract.def"
  start.reference_objective = message.reference_objective();
  return start;
}

}  // namespace marble
