#include <string_view>
#include <utility>

#include "marble/convert.h"

namespace marble {
namespace {

using Field = google::protobuf::RepeatedField<double>;

std::span<const double> span_of(const Field& field) {
  return {field.data(), static_cast<std::size_t>(field.size())};
}

template <class Values>
void assign(Field* field, const Values& values) {
  field->Assign(values.begin(), values.end());
}

std::vector<double> vector_of(const Field& field) { return {field.begin(), field.end()}; }
std::vector<Index> vector_of(const google::protobuf::RepeatedField<std::int32_t>& field) {
  return {field.begin(), field.end()};
}

template <class Numbers>
void numbers_to_message(const Numbers& numbers, v1::ProblemNumbers* message) {
#define MARBLE_VECTOR(letter, field) assign(message->mutable_##field(), numbers.letter);
#define MARBLE_MATRIX(letter, field, values, vector) assign(message->mutable_##values(), numbers.letter);
#include "marble/contract.def"
}

template <class Vectors>
void vectors_to_message(const Vectors& vectors, v1::AnswerVectors* message) {
  assign(message->mutable_z(), vectors.z);
  assign(message->mutable_equality_multipliers(), vectors.equality_multipliers);
  assign(message->mutable_inequality_multipliers(), vectors.inequality_multipliers);
  assign(message->mutable_complementarity_multipliers_l(), vectors.complementarity_multipliers_L);
  assign(message->mutable_complementarity_multipliers_r(), vectors.complementarity_multipliers_R);
}

void to_message(const Error& error, v1::Fault* message) {
  message->set_field(error.field);
  if (error.index >= 0) message->set_index(error.index);
  message->set_value(error.value);
  message->set_bound(error.bound);
}

Error error_of(const v1::Fault& message) {
  return {ErrorCode::failed_precondition, message.field(), message.has_index() ? message.index() : -1,
          message.value(), message.bound()};
}

// Returns the message's value, or its error if it contains one.
template <class Message, class Take>
auto unless_error(const Message& message, const Take& take) -> Expected<decltype(take(message))> {
  if (message.has_error()) return unexpected(error_of(message.error()));
  return take(message);
}

RowResponse response_of(const v1::RowResponse& m) {
  return {vector_of(m.values()), vector_of(m.free()), vector_of(m.response()), vector_of(m.z()),
          vector_of(m.columns())};
}

AnswerChanges changes_of(const v1::AnswerChanges& m) {
  const v1::AnswerVectors& vectors = m.vectors();
  return {vector_of(vectors.z()),
          vector_of(vectors.equality_multipliers()),
          vector_of(vectors.inequality_multipliers()),
          vector_of(vectors.complementarity_multipliers_l()),
          vector_of(vectors.complementarity_multipliers_r()),
          {m.active_set_constant().begin(), m.active_set_constant().end()},
          vector_of(m.undefined())};
}

ProblemGradients gradients_of(const v1::ProblemGradients& m) {
  ProblemGradients gradients;
#define MARBLE_VECTOR(letter, field) gradients.letter = vector_of(m.numbers().field());
#define MARBLE_MATRIX(letter, field, values, vector) gradients.letter = vector_of(m.numbers().values());
#include "marble/contract.def"
  gradients.undefined = vector_of(m.undefined());
  return gradients;
}

struct FieldNames {
  const char *core, *message;
};
constexpr FieldNames kNames[] = {
    {"rows.E", "rows.matrix"},
    {"rows.g", "rows.gradient"},
    {"losses.complementarity_multipliers_L", "losses.weights.complementarity_multipliers_l"},
    {"losses.complementarity_multipliers_R", "losses.weights.complementarity_multipliers_r"}};

// Replaces the head of a path by the other side's name; empty if the path has another head.
std::string renamed(const std::string& field, std::string_view from, const char* to) {
  const bool is_head = field.starts_with(from) && (field.size() == from.size() || field[from.size()] == '.');
  return is_head ? to + field.substr(from.size()) : std::string();
}

}  // namespace

SensitivityRequest request_of(const v1::SensitivityRequest& m) {
  SensitivityRequest request;
  if (m.has_rows()) {
    request.rows = RowsRequest{.E = view_of(m.rows().matrix()),
                               .proximal = span_of(m.rows().proximal()),
                               .g = span_of(m.rows().gradient()),
                               .columns = m.rows().columns()};
  }
  request.directions.count = m.directions().count();
  const v1::ProblemNumbers& numbers = m.directions().numbers();
#define MARBLE_VECTOR(letter, field) request.directions.numbers.letter = span_of(numbers.field());
#define MARBLE_MATRIX(letter, field, values, vector) \
  request.directions.numbers.letter = span_of(numbers.values());
#include "marble/contract.def"
  const v1::AnswerVectors& weights = m.losses().weights();
  request.losses = {
      m.losses().count(),
      {span_of(weights.z()), span_of(weights.equality_multipliers()),
       span_of(weights.inequality_multipliers()), span_of(weights.complementarity_multipliers_l()),
       span_of(weights.complementarity_multipliers_r())}};
  return request;
}

void to_message(const SensitivityRequest& request, v1::SensitivityRequest* message) {
  if (request.rows) {
    v1::RowsRequest* rows = message->mutable_rows();
    to_message(request.rows->E, rows->mutable_matrix());
    assign(rows->mutable_proximal(), request.rows->proximal);
    assign(rows->mutable_gradient(), request.rows->g);
    rows->set_columns(request.rows->columns);
  }
  if (request.directions.count != 0) {
    message->mutable_directions()->set_count(request.directions.count);
    numbers_to_message(request.directions.numbers, message->mutable_directions()->mutable_numbers());
  }
  if (request.losses.count != 0) {
    message->mutable_losses()->set_count(request.losses.count);
    vectors_to_message(request.losses.weights, message->mutable_losses()->mutable_weights());
  }
}

void to_message(const Expected<SensitivityAnswer>& answer, v1::Sensitivity* message) {
  if (!answer) return to_message(answer.error(), message->mutable_error());
  message->mutable_weak_inequalities()->Assign(answer->weak_inequalities.begin(),
                                               answer->weak_inequalities.end());
  message->mutable_biactive_pairs()->Assign(answer->biactive_pairs.begin(), answer->biactive_pairs.end());
  message->set_factorizations(answer->factorizations);
  message->set_back_substitutions(answer->back_substitutions);
  if (answer->rows) {
    v1::RowResponse* rows = message->mutable_rows();
    if (*answer->rows) {
      const RowResponse& response = **answer->rows;
      assign(rows->mutable_values(), response.values);
      assign(rows->mutable_free(), response.free);
      assign(rows->mutable_response(), response.response);
      assign(rows->mutable_z(), response.z);
      assign(rows->mutable_columns(), response.columns);
    } else {
      to_message(answer->rows->error(), rows->mutable_error());
    }
  }
  if (const AnswerChanges& changes = answer->changes; !changes.active_set_constant.empty()) {
    v1::AnswerChanges* reported = message->mutable_changes();
    vectors_to_message(changes, reported->mutable_vectors());
    reported->mutable_active_set_constant()->Assign(changes.active_set_constant.begin(),
                                                    changes.active_set_constant.end());
    reported->mutable_undefined()->Assign(changes.undefined.begin(), changes.undefined.end());
  }
  if (const ProblemGradients& gradients = answer->gradients; !gradients.g.empty()) {
    v1::ProblemGradients* reported = message->mutable_gradients();
    numbers_to_message(gradients, reported->mutable_numbers());
    reported->mutable_undefined()->Assign(gradients.undefined.begin(), gradients.undefined.end());
  }
}

Expected<SensitivityAnswer> sensitivity_of(const v1::Sensitivity& message) {
  return unless_error(message, [](const v1::Sensitivity& m) {
    SensitivityAnswer answer;
    answer.weak_inequalities = vector_of(m.weak_inequalities());
    answer.biactive_pairs = vector_of(m.biactive_pairs());
    answer.factorizations = m.factorizations();
    answer.back_substitutions = m.back_substitutions();
    if (m.has_rows()) answer.rows = unless_error(m.rows(), response_of);
    answer.changes = changes_of(m.changes());
    answer.gradients = gradients_of(m.gradients());
    return answer;
  });
}

std::string sensitivity_field(const std::string& field) {
  for (const auto& [core, message] : kNames) {
    if (auto name = renamed(field, core, message); !name.empty()) return name;
  }
  if (field.ends_with(".count") || field.starts_with("rows.")) return field;
  const std::size_t head = field.find('.');
  const std::string tail = field.substr(head + 1);
  return field.starts_with("directions.") ? "directions.numbers." + update_field(tail)
                                          : "losses.weights." + tail;
}

std::string core_sensitivity_field(const std::string& field) {
  constexpr std::string_view kNumbers = "directions.numbers.", kWeights = "losses.weights.";
  for (const auto& [core, message] : kNames) {
    if (auto name = renamed(field, message, core); !name.empty()) return name;
  }
  if (field.starts_with(kNumbers)) return "directions." + core_field(field.substr(kNumbers.size()));
  return field.starts_with(kWeights) ? "losses." + field.substr(kWeights.size()) : field;
}

}  // namespace marble
