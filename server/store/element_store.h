// Elements of arrays and their answers, whatever keeps them: memory or the file of this server's jobs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "store/group_writer.h"
#include "store/running_jobs.h"

namespace marble::server {

struct StoredJob;
struct StoredResult;

/// One element of an array as it came.
struct StoredElement {
  std::string array = {};    ///< id of its job
  std::int64_t index = 0;    ///< from 0
  std::string request = {};  ///< a marble.v1.ArrayElement
};

/// How an element ended, as a number in a row.
enum class ElementEnd { unsolved = 0, solved = 1, failed = 2 };

/// What came of one.
struct ElementAnswer {
  std::string array = {};
  std::int64_t index = 0;
  std::int64_t sequence = 0;  ///< read, not written: the order of the array's answers, from 1
  ElementEnd end = ElementEnd::unsolved;
  std::int64_t iterations = 0, factorizations = 0;
  std::string message = {};  ///< a marble.v1.ArrayResultsResponse without its sequence
};

/// The name of an element as a job.
[[nodiscard]] inline std::string element_id(const std::string& array, std::int64_t index) {
  return array + "." + std::to_string(index);
}

/// Thread-safe. Changes are made in the order in which they were asked for.
class ElementStore {
 public:
  virtual ~ElementStore() = default;

  /// An array whose elements are still to come: until it is sealed nothing of it survives a restart. Its
  /// request is a marble.v1.ArraySetup.
  virtual void open_array(StoredJob array, Settled settled) = 0;
  virtual void add_element(StoredElement element, Settled settled) = 0;
  /// It is whole. Nothing is sealed if it does not have so many elements, as one of them could not be
  /// written.
  virtual void seal_array(const std::string& id, std::int64_t elements, const std::string& digest,
                          Settled settled) = 0;
  /// Errors: not_found.
  [[nodiscard]] virtual Expected<std::string> element(const std::string& array, std::int64_t index) = 0;

  /// The answer's sequence is the array's next: told once it is kept, in that order. Its request goes.
  virtual void answer_element(ElementAnswer answer, Settled settled) = 0;
  /// Those after a sequence number in their order: one, if there is any, and more up to so many bytes.
  [[nodiscard]] virtual Expected<std::vector<ElementAnswer>> answers_after(const std::string& array,
                                                                           std::int64_t after,
                                                                           std::int64_t most_bytes) = 0;

  /// The array as a job has ended.
  virtual void finish(StoredResult result, Settled settled) = 0;
  virtual void cancel(const std::string& id) = 0;
  virtual void forget(const std::string& id) = 0;

  /// An element runs from here to there: JobStore::began().
  virtual void began(const JobStart& start) = 0;
  virtual void ended(const std::string& id) = 0;
  /// Whether what is kept outlives the server.
  [[nodiscard]] virtual bool is_durable() const = 0;
  /// When all that was asked for until now is made.
  virtual void when_settled(Settled settled) = 0;
};

}  // namespace marble::server
