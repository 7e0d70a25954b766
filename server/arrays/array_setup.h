// What all elements of an array share, and what each then asks for.
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

  /// The element as a request of its own, which is still to be checked. Error fields are paths from the
  /// element's root. Errors: invalid_argument.
  [[nodiscard]] Expected<std::shared_ptr<v1::SolveRequest>> request(v1::ArrayElement element) const;

  /// As it came, but for the entries of Q below the diagonal.
  [[nodiscard]] const v1::ArraySetup& message() const { return message_; }
  [[nodiscard]] const Options& options() const { return checked_.options; }
  /// Of the array's job, which nobody sees yet.
  [[nodiscard]] const std::shared_ptr<JobRecord>& record() const { return checked_.record; }

 private:
  ArraySetup(v1::ArraySetup message, CheckedArray checked);
  void apply(v1::ProblemUpdate& update, v1::Problem& problem) const;

  v1::ArraySetup message_;
  const CheckedArray checked_;
  std::vector<int> upper_;  // entries of Q in the order of the set-up that are not below the diagonal
};

/// Why an element by this number is wrong, as the array's client is told.
[[nodiscard]] Error of_element(std::int64_t index, Error error);

}  // namespace marble::server
