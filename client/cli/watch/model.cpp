#include "watch/model.h"

namespace marble::cli {

void OpenedJob::update(const JobEvent& event) {
  if (event.trace) {
    trace = {};
    newest.clear();
    for (const Progress& row : event.trace->rows) add(row);
  }
  for (const Progress& row : event.rows) add(row);
  job = event.job;
  skipped = event.skipped;
  gone = false;
}

void OpenedJob::add(const Progress& row) {
  // The next update of a session counts from the start again.
  if (!newest.empty() && row.iteration < newest.back().iteration) trace = {};
  trace.add(without_vectors(row));
  newest.push_back(without_vectors(row));
  if (newest.size() > kNewestRows) newest.pop_front();
}

}  // namespace marble::cli
