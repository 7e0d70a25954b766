#include "file/binary_problem.h"

#include <limits>

#include "marble/convert.h"
#include "message_text.h"

namespace marble::client {
namespace {

SparseMatrix owned(const SparseMatrixView& view) {
  return {view.rows,
          view.columns,
          {view.column_pointers.begin(), view.column_pointers.end()},
          {view.row_indices.begin(), view.row_indices.end()},
          {view.values.begin(), view.values.end()}};
}

std::vector<double> owned(std::span<const double> values) { return {values.begin(), values.end()}; }

}  // namespace

Expected<ProblemFile> parse_binary(std::string_view content, const std::string& name) {
  v1::Problem message;
  if (content.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()) ||
      !message.ParseFromArray(content.data(), static_cast<int>(content.size()))) {
    return unexpected(failure(ErrorCode::invalid_argument,
                              "is not a marble.v1.Problem message (truncated, or of another format)"));
  }
  const ProblemView view = view_of(message);
  if (const auto valid = Problem::create(view); !valid)
    return unexpected(of_field(message_field(valid.error().field), valid.error()));
  ProblemFile file;
  OwnedProblem& problem = file.problem;
  problem.name = message.name().empty() ? name : message.name();
  problem.hessian_form = view.hessian_form;
  problem.c0 = view.c0;
#define MARBLE_VECTOR(letter, field) problem.letter = owned(view.letter);
#define MARBLE_MATRIX(letter, field, update, vector) problem.letter = owned(view.letter);
#include "marble/contract.def"
  return file;
}

std::string write_binary(const ProblemFile& file) {
  v1::Problem message;
  to_message(file.problem.view(), &message);
  message.set_name(message_text(file.problem.name, contract::longest_problem_name));
  return message.SerializeAsString();
}

}  // namespace marble::client
