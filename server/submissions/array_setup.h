// What all elements of an array share, and the request of each element.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "marble/v1/service.pb.h"
#include "service/admission.h"

namespace marble::server {

/// Immutable.
class ArraySetup {
 public:
  /// Error fields are paths from the message's root. Errors: invalid_argument, permission_denied (its
  /// priority).
  [[nodiscard]] static Expected<std::shared_ptr<const ArraySetup>> check(const ServiceParts& parts,
                                                                         const Caller& caller,
                                                                         v1::ArraySetup message);

  /// Returns the element as a separate request, which is not checked yet. Error fields are paths from the
  /// element's root. Errors: invalid_argument.
  [[nodiscard]] Expected<std::shared_ptr<v1::SolveRequest>> request(v1::ArrayElement element) const;

  /// As received, without the entries of Q below the diagonal.
  [[nodiscard]] const v1::ArraySetup& message() const { return message_; }
  [[nodiscard]] const Options& options() const { return checked_.options; }
  /// Of the array's job, which no one sees yet.
  [[nodiscard]] const std::shared_ptr<JobRecord>& record() const { return checked_.record; }

 private:
  ArraySetup(v1::ArraySetup message, CheckedArray checked);
  void apply(v1::ProblemUpdate& update, v1::Problem& problem) const;

  v1::ArraySetup message_;
  const CheckedArray checked_;
  std::vector<int> upper_;  // entries of Q that are not below the diagonal, in the order of the set-up
};

/// Returns the error of an element in the form for the array's client.
[[nodiscard]] Error of_element(std::int64_t index, Error error);

}  // namespace marble::server
