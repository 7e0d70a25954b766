// Interface for elements of arrays and their results: in memory, in the file of this server's jobs, or in a
// store that several servers share.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "store/group_writer.h"
#include "store/running_jobs.h"

namespace marble::server {

struct StoredJob;
struct StoredResult;

/// One element of an array as received.
struct StoredElement {
  std::string array = {};    ///< id of its job
  std::int64_t index = 0;    ///< counts from 0
  std::string request = {};  ///< a marble.v1.ArrayElement
};

/// How an element ended, as a number in a row.
enum class ElementEnd { unsolved = 0, solved = 1, failed = 2 };

/// The result of one.
struct ElementAnswer {
  std::string array = {};
  std::int64_t index = 0;
  std::int64_t sequence = 0;  ///< only read: order of the array's results, from 1
  ElementEnd end = ElementEnd::unsolved;
  std::int64_t iterations = 0, factorizations = 0;
  std::string message = {};  ///< a marble.v1.ArrayResultsResponse without its sequence
};

/// Returns the name of an element as a job.
[[nodiscard]] inline std::string element_id(const std::string& array, std::int64_t index) {
  return array + "." + std::to_string(index);
}

/// An element that this server may run now.
struct ClaimedElement {
  std::int64_t index = 0;
  std::int64_t lost = 0;                    ///< starts during which a server died
  std::optional<std::string> request = {};  ///< empty if the store has lost it
};

/// Elements that wait or run, and results. Thread-safe. Changes are made in the order of the calls.
class ElementStore {
 public:
  virtual ~ElementStore() = default;

  /// Returns the request. Errors: not_found.
  [[nodiscard]] virtual Expected<std::string> element(const std::string& array, std::int64_t index) = 0;

  /// The result gets the array's next sequence number, is reported once it is kept, in that order, and its
  /// request is deleted.
  virtual void answer_element(ElementAnswer answer, CompletionCallback settled) = 0;
  /// Returns the results after a sequence number in order: one, if there is any, and more up to this many
  /// bytes.
  [[nodiscard]] virtual Expected<std::vector<ElementAnswer>> answers_after(const std::string& array,
                                                                           std::int64_t after,
                                                                           std::int64_t most_bytes) = 0;

  /// The array's job has ended.
  virtual void finish(StoredResult result, CompletionCallback settled) = 0;
  virtual void cancel(const std::string& id) = 0;

  /// Marks the time in which an element runs: JobStore::began().
  virtual void began(const JobStart& start) = 0;
  virtual void ended(const std::string& id) = 0;
  /// True if the contents outlive the server.
  [[nodiscard]] virtual bool is_durable() const = 0;

  /// True if other servers may continue the array: elements are then claimed before they run, and readers
  /// get the results from the store.
  [[nodiscard]] virtual bool is_shared() const { return false; }
  using Claimed = std::function<void(const Expected<std::vector<ClaimedElement>>&)>;
  /// Claims the next elements for this server, none if there are no more: one of those that were claimed when
  /// a server died, or up to `most` others. Only if is_shared().
  virtual void claim(bool /*suspect*/, std::int64_t /*most*/, Claimed /*then*/) {}
};

/// Also receives arrays. Thread-safe.
class ArrayStore : public ElementStore {
 public:
  /// Opens an array whose elements follow: until it is sealed, nothing of it survives a restart. Its request
  /// is a marble.v1.ArraySetup.
  virtual void open_array(StoredJob array, CompletionCallback settled) = 0;
  virtual void add_element(StoredElement element, CompletionCallback settled) = 0;
  /// Marks the array as complete. Nothing is sealed if it has a different number of elements, because one of
  /// them could not be written.
  virtual void seal_array(const std::string& id, std::int64_t elements, const std::string& digest,
                          CompletionCallback settled) = 0;
  virtual void forget(const std::string& id) = 0;
  /// Calls back when all earlier changes are done.
  virtual void when_settled(CompletionCallback settled) = 0;
};

}  // namespace marble::server
