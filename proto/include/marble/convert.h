// The only conversions between messages and the core's values. Arrays of incoming messages are viewed, not
// copied.
#pragma once

#include <limits>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/sensitivity.h"
#include "marble/solution.h"
#include "marble/v1/options.pb.h"
#include "marble/v1/problem.pb.h"
#include "marble/v1/progress.pb.h"
#include "marble/v1/sensitivity.pb.h"
#include "marble/v1/session.pb.h"
#include "marble/v1/solution.pb.h"

namespace marble {

/// Returns views of a message's arrays; the message must outlive them. Checks nothing: Problem::create does.
[[nodiscard]] ProblemView view_of(const v1::Problem& message);

/// The same for one matrix.
[[nodiscard]] SparseMatrixView view_of(const v1::SparseMatrix& message);

/// Returns views of an update's arrays; the message must outlive them. Checks nothing: PartSizes::check
/// does.
[[nodiscard]] ProblemUpdate update_of(const v1::ProblemUpdate& message);

/// Copies an update into a message.
void to_message(const ProblemUpdate& update, v1::ProblemUpdate* message);

/// Copies a problem into a message.
void to_message(const ProblemView& problem, v1::Problem* message);
/// The same for one matrix.
void to_message(const SparseMatrixView& matrix, v1::SparseMatrix* message);

/// Returns views of a matrix's arrays; the message must outlive them.
[[nodiscard]] SparseMatrixView view_of(const v1::SparseMatrix& message);
/// Copies a matrix into a message.
void to_message(const SparseMatrixView& matrix, v1::SparseMatrix* message);

/// Returns views of a request's arrays; the message must outlive them. Checks nothing: check() does.
[[nodiscard]] SensitivityRequest request_of(const v1::SensitivityRequest& message);
/// Copies a request for derivatives of a solution into a message.
void to_message(const SensitivityRequest& request, v1::SensitivityRequest* message);
/// Copies the derivatives, or the error that explains why there are none.
void to_message(const Expected<SensitivityAnswer>& answer, v1::Sensitivity* message);
[[nodiscard]] Expected<SensitivityAnswer> sensitivity_of(const v1::Sensitivity& message);
/// Returns the path in SensitivityRequest of a field named by check(): "directions.A.values" →
/// "directions.numbers.equality_values"; and the inverse.
[[nodiscard]] std::string sensitivity_field(const std::string& core_field);
[[nodiscard]] std::string core_sensitivity_field(const std::string& message_field);

/// Returns the path in the request of a field named by the core: "A.row_indices" →
/// "equality_matrix.row_indices", "initial_z" → "initial_point.z".
[[nodiscard]] std::string message_field(const std::string& core_field);
/// The same in an update, where a matrix has only its values: "A.values" → "equality_values".
[[nodiscard]] std::string update_field(const std::string& core_field);
/// The inverse of both, and of "sensitivity." with a path of a SensitivityRequest; a path that is not one of
/// a problem is returned unchanged.
[[nodiscard]] std::string core_field(const std::string& message_field);

/// Returns a google.rpc.Code.
[[nodiscard]] int to_message(ErrorCode code);
/// The inverse; `internal` for a code that no Marble server sends.
[[nodiscard]] ErrorCode error_code_of(int google_rpc_code);

/// Absent fields keep their value in `defaults`; ranges are checked. Error fields are option names.
[[nodiscard]] Expected<Options> options_of(const v1::SolveOptions& message, const Options& defaults = {});
/// Sets every field, so that the message contains all options that were used.
void to_message(const Options& options, v1::SolveOptions* message);
/// Describes every option, from the option table.
void to_message(const OptionInfo& option, v1::OptionSchema* message);

void to_message(const Conflict& conflict, v1::Conflict* message);
[[nodiscard]] Conflict conflict_of(const v1::Conflict& message);
void to_message(const Violations& violations, v1::Violations* message);
[[nodiscard]] Violations violations_of(const v1::Violations& message);

/// Copies the state of a tree (option global_search) of Progress or a job. Unknown values are absent in the
/// message, so that a solve without a tree sends none of them, and infinite in `reported`.
template <class Reported, class Message>
void tree_to_message(const Reported& reported, Message* message) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (reported.incumbent < kInfinity) message->set_incumbent(reported.incumbent);
  if (reported.bound > -kInfinity) message->set_bound(reported.bound);
  if (reported.gap < kInfinity) message->set_gap(reported.gap);
  message->set_nodes(reported.nodes);
  message->set_open_nodes(reported.open_nodes);
}
template <class Message, class Reported>
void take_tree(const Message& message, Reported& reported) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  reported.incumbent = message.has_incumbent() ? message.incumbent() : kInfinity;
  reported.bound = message.has_bound() ? message.bound() : -kInfinity;
  reported.gap = message.has_gap() ? message.gap() : kInfinity;
  reported.nodes = message.nodes();
  reported.open_nodes = message.open_nodes();
}

void to_message(const Activity& activity, v1::Activity* message);
[[nodiscard]] Activity activity_of(const v1::Activity& message);
/// Copies everything except z, which is sent only if requested.
void to_message(const Progress& progress, v1::Progress* message);
/// z views the message, which must outlive it.
[[nodiscard]] Progress progress_of(const v1::Progress& message);

[[nodiscard]] v1::Status to_message(Status status);
[[nodiscard]] Status status_of(v1::Status status);

/// Copies the fields of solution.def, so everything except the queue and total times and the options, which
/// the service knows.
void to_message(const Solution& solution, v1::Solution* message);
[[nodiscard]] Solution solution_of(const v1::Solution& message);
/// Copies the start of a solve: only the vectors and the reference objective (reference_objective).
void to_message(const Solution& start, v1::WarmStart* message);
[[nodiscard]] Solution solution_of(const v1::WarmStart& message);

}  // namespace marble
