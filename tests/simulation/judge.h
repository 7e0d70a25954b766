// What every client was promised, checked against what it sees.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>

#include "environment.h"
#include "marble/error.h"
#include "marble/v1/service.pb.h"

namespace marble::simulation {

/// Request ids of jobs that kill the server that runs them begin so.
constexpr std::string_view kFatal = "fatal";

/// A job that a client has asked for, and what it knows of it.
struct Known {
  std::string request_id = {};
  double gradient = 0.0;
  std::string id = {};   // empty until the server has said it
  bool deleted = false;  // asked for, whether or not the answer came
  bool gone = false;     // its deletion was confirmed
  bool cancelled = false;
  bool ended = false;               // seen as finished
  std::string answer = {};          // as first seen
  std::int64_t crashes_before = 0;  // of the server, when it was first asked for
  std::int64_t full_changes = 0;    // of the disk, when it was last asked for its answer
  std::int64_t unwritten_at =
      -1;  // lives of the server, when an answer came while the disk may have been full
};

/// Thread-safe, but for a Known, which is its client's.
class Judge {
 public:
  Judge(const Plan& plan, Outcome& outcome) : plan_(plan), outcome_(outcome) {}

  /// Keeps a line for the report of a violation.
  void note(const std::string& line);
  /// Prints the violation with the last events, and ends the process.
  [[noreturn]] void violated(const std::string& what);
  void expect(bool holds, const std::string& what);
  void must(const Expected<void>& done, const std::string& what);

  /// The server is about to run a job, and dies of it if the job is fatal.
  void begins(std::string_view request_id);
  /// A submission was not answered: the job may have run before it was kept.
  void submission_lost(const Known& known);
  /// The job's cancellation or deletion was confirmed.
  void is_over(const Known& known);
  void set_disk_full(bool full);

  /// Before a call for the job's answer, and after it.
  void asks(Known& known);
  /// Judges the answer. True if the job has ended, or does not exist for good reasons.
  bool answered(Known& known, const Error& error);
  bool answered(Known& known, const v1::SolveResponse& response);

 private:
  void forget_unwritten(Known& known);
  bool same(Known& known, const std::string& answer);
  [[nodiscard]] std::int64_t lives() const { return outcome_.crashes + outcome_.stops; }

  const Plan plan_;
  Outcome& outcome_;
  std::mutex mutex_;
  std::deque<std::string> history_;
  std::set<std::string, std::less<>> over_;         // request ids of jobs whose end was confirmed
  std::map<std::string, int, std::less<>> deaths_;  // of the server, by the request id of the job that it ran
  std::map<std::string, int, std::less<>> lost_submits_;  // by request id
  bool full_ = false;                                     // the disk
  std::int64_t full_changes_ = 0;
};

}  // namespace marble::simulation
