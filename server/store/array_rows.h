// Arrays in the file of jobs: their tables, and reading and writing them.
#pragma once

#include <functional>
#include <vector>

#include "store/element_store.h"
#include "store/sqlite.h"

namespace marble::server {

/// SQL that makes the tables of arrays beside those of jobs.
extern const char* const kArrayTables;

/// An element without its request and result.
struct ElementRow {
  std::int64_t index = 0;
  std::int64_t lost = 0;           ///< starts during which the server died
  std::int64_t request_bytes = 0;  ///< size of the request of an element without a result
  std::int64_t sequence = 0;       ///< sequence of its result; 0 while there is none
  std::int64_t answer_bytes = 0;
  ElementEnd end = ElementEnd::unsolved;
  std::int64_t iterations = 0, factorizations = 0;
};
/// Returns the element in a row of each_element(); a column may be of any type.
[[nodiscard]] ElementRow element_in(const Statement& row);

[[nodiscard]] Expected<void> add_element(Database& database, const StoredElement& element);
[[nodiscard]] Expected<void> seal_array(Database& database, const std::string& id, std::int64_t elements,
                                        const std::string& digest);
[[nodiscard]] Expected<void> answer_element(Database& database, const ElementAnswer& answer);
/// Sets the number of starts of an element during which the server died.
[[nodiscard]] Expected<void> count_element_starts(Database& database, const JobStart& start);

[[nodiscard]] Expected<std::string> read_element(Database& database, const std::string& array,
                                                 std::int64_t index);
[[nodiscard]] Expected<std::vector<ElementAnswer>> read_answers(Database& database, const std::string& array,
                                                                std::int64_t after, std::int64_t most_bytes);
[[nodiscard]] Expected<void> each_element(Database& database, const std::string& array,
                                          const std::function<void(const ElementRow&)>& report);

}  // namespace marble::server
