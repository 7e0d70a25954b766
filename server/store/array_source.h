// The results of one array, as its readers get them.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "marble/v1/service.pb.h"
#include "store/element_store.h"

namespace marble::server {

/// Returns a stored result as its message. A row of the store may contain anything: what cannot be read is an
/// error of that element.
[[nodiscard]] v1::ArrayResultsResponse message_of(const ElementAnswer& answer);

/// Receives an array's results.
class ArrayListener {
 public:
  virtual ~ArrayListener() = default;
  /// There are more results, or the array is over. Called on any thread, without a lock.
  virtual void news() = 0;
};

/// Thread-safe.
class ArraySource {
 public:
  virtual ~ArraySource() = default;

  /// The results after a given number.
  struct News {
    std::vector<ElementAnswer> answers;
    bool is_over = false;           ///< no more follow
    std::optional<Error> end = {};  ///< set for an array that is over: why before its last element
  };
  /// Without results, unless the array is over, the listener is notified when there are some. Errors:
  /// not_found (it was dropped), unavailable (the store cannot be read).
  [[nodiscard]] virtual Expected<News> news_after(std::int64_t sequence, std::int64_t most_bytes) = 0;
  /// Notifies the listener from now on.
  virtual void listen(const std::weak_ptr<ArrayListener>& listener) = 0;
};

/// Returns the error of a reader whose array was deleted.
[[nodiscard]] inline Error array_deleted(const std::string& id) {
  return failure(ErrorCode::not_found, "job_id", id, "was deleted, and its answers with it");
}
/// Returns the error of a repeated array whose first copy was dropped before it was complete.
[[nodiscard]] inline Error array_dropped() {
  return failure(ErrorCode::unavailable, "the array of this request_id was dropped just now: send it again");
}
/// Returns the error if there is no array by this id.
[[nodiscard]] inline Error no_array(const std::string& id) {
  return failure(ErrorCode::not_found, "job_id", id, "is no array, or its answers are not kept any more");
}

/// An array for one reader.
struct FoundArray {
  std::shared_ptr<ArraySource> results;
  std::string client;  ///< who may read it
  std::int64_t elements = 0;
};

}  // namespace marble::server
