#include "submissions/array_setup.h"

#include <utility>

#include "marble/convert.h"
#include "service/coupled_work.h"

namespace marble::server {
namespace {

// Keeps only the upper triangle of Q: an update of a full Q reads nothing else, and the mirrored entries
// follow from it. Returns the entries that stay.
std::vector<int> keep_upper(v1::Problem& problem) {
  std::vector<int> kept;
  if (problem.hessian_form() == v1::HESSIAN_FORM_UPPER_TRIANGLE) return kept;
  v1::SparseMatrix& full = *problem.mutable_hessian();
  v1::SparseMatrix upper;
  upper.set_rows(full.rows());
  upper.set_columns(full.columns());
  upper.add_column_pointers(0);
  for (int column = 0; column + 1 < full.column_pointers_size(); ++column) {
    for (int at = full.column_pointers(column); at < full.column_pointers(column + 1); ++at) {
      if (full.row_indices(at) > column) continue;
      upper.add_row_indices(full.row_indices(at));
      upper.add_values(full.values(at));
      kept.push_back(at);
    }
    upper.add_column_pointers(upper.values_size());
  }
  full.Swap(&upper);
  problem.set_hessian_form(v1::HESSIAN_FORM_UPPER_TRIANGLE);
  return kept;
}

template <class Field>
void take_field(Field* from, Field* to) {
  if (!from->empty()) to->Swap(from);
}

Error not_its_own(const char* field) {
  return invalid(std::string("solve.") + field, "must be absent: the set-up has it for all elements");
}

}  // namespace

ArraySetup::ArraySetup(v1::ArraySetup message, CheckedArray checked)
    : message_(std::move(message)), checked_(std::move(checked)) {
  if (message_.has_problem() && message_.problem().has_hessian())
    upper_ = keep_upper(*message_.mutable_problem());
}

Expected<std::shared_ptr<const ArraySetup>> ArraySetup::check(const ServiceParts& parts, const Caller& caller,
                                                              v1::ArraySetup message) {
  MARBLE_ASSIGN_OR_RETURN(
      auto checked, check_request(parts, caller, parts.access.quota_of(caller.identity.client), message));
  return std::shared_ptr<const ArraySetup>(new ArraySetup(std::move(message), std::move(checked)));
}

Expected<std::shared_ptr<v1::SolveRequest>> ArraySetup::request(v1::ArrayElement element) const {
  auto request = std::make_shared<v1::SolveRequest>();
  request->Swap(element.mutable_solve());
  if (!request->request_id().empty()) return unexpected(not_its_own("request_id"));
  if (request->priority() != v1::PRIORITY_UNSPECIFIED) return unexpected(not_its_own("priority"));
  const bool is_whole = request->has_problem() || has_blocks(*request);
  if (element.has_update()) {
    if (!checked_.base) return unexpected(invalid("update", "must come with a base problem in the set-up"));
    if (is_whole) return unexpected(invalid("update", "must not come with a problem of its own"));
    if (auto valid = checked_.base->check(update_of(element.update())); !valid)
      return unexpected(of_field("update." + update_field(valid.error().field), valid.error()));
  }
  if (checked_.base && !is_whole) {
    *request->mutable_problem() = message_.problem();
    apply(*element.mutable_update(), *request->mutable_problem());
  }
  if (message_.has_options()) {
    v1::SolveOptions options = message_.options();
    options.MergeFrom(request->options());
    request->mutable_options()->Swap(&options);
  }
  return request;
}

void ArraySetup::apply(v1::ProblemUpdate& update, v1::Problem& problem) const {
  if (update.has_constant()) problem.set_constant(update.constant());
  if (!upper_.empty() && update.hessian_values_size() > 0) {
    auto* const values = problem.mutable_hessian()->mutable_values();
    for (int at = 0; at < values->size(); ++at)
      values->Set(at, update.hessian_values(upper_[static_cast<std::size_t>(at)]));
    update.clear_hessian_values();
  }
#define MARBLE_VECTOR(letter, field) take_field(update.mutable_##field(), problem.mutable_##field());
#define MARBLE_MATRIX(letter, field, numbers, vector) \
  if (update.numbers##_size() > 0)                    \
    problem.mutable_##field()->mutable_values()->Swap(update.mutable_##numbers());
#include "marble/contract.def"
}

Error of_element(std::int64_t index, Error error) {
  const std::string element = "elements[" + std::to_string(index) + "]";
  return error.field.empty() ? of_field(element, std::move(error)) : inside(element, std::move(error));
}

}  // namespace marble::server
