#include "judge.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "threads.h"

namespace marble::simulation {
namespace {

constexpr std::size_t kHistory = 60;  // events that a report shows
constexpr int kStarts = 2;            // setting job_starts

double seconds_now() { return std::chrono::duration<double>(now()).count(); }

}  // namespace

void Judge::violated(const std::string& what) {
  std::string text;
  for (const std::string& line : history_) text += line + '\n';
  std::printf("seed %llu: %s\nafter %.3f s:\n%s", static_cast<unsigned long long>(plan_.seed), what.c_str(),
              seconds_now(), text.c_str());
  std::fflush(stdout);
  _exit(1);
}

void Judge::note(const std::string& line) {
  const std::lock_guard lock(mutex_);
  char time[32];
  std::snprintf(time, sizeof time, "%12.6f  ", seconds_now());
  history_.push_back(time + line);
  if (history_.size() > kHistory) history_.pop_front();
}
void Judge::must(const Expected<void>& done, const std::string& what) {
  if (!done) violated(what + " fails: " + done.error().message());
}
void Judge::expect(bool holds, const std::string& what) {
  if (!holds) violated(what);
}

bool Judge::answered(Known& known, const Error& error) {
  forget_unwritten(known);
  note("Result " + known.id + ": " + error.message());
  switch (error.code) {
    case ErrorCode::not_found:
      // Until its deletion is confirmed, a server that dies may have it again.
      expect(known.deleted, "job " + known.id + ", which was accepted, is not known any more");
      return true;
    case ErrorCode::failed_precondition:
      expect(!known.ended, "job " + known.id + " had ended, and has not");
      return false;
    case ErrorCode::unavailable:  // the server stops
      expect(!known.ended, "job " + known.id + " had an answer, and has none: " + error.message());
      return false;
    default:
      // A job that ran at two crashes is not begun a third time, whether or not it was their cause.
      expect(known.cancelled || known.deleted || outcome_.crashes >= known.crashes_before + 2,
             "job " + known.id + " fails: " + error.message());
      return same(known, "error " + error.message());
  }
}

bool Judge::answered(Known& known, const v1::SolveResponse& response) {
  forget_unwritten(known);
  expect(!known.gone, "job " + known.id + ", which was deleted, has an answer");
  const v1::Solution& solution = response.solution();
  note("Result " + known.id + ": status " + std::to_string(solution.status()));
  expect(response.job_id() == known.id, "the answer of " + known.id + " is that of " + response.job_id());
  expect(!known.request_id.starts_with(kFatal), "a job that kills its server has an answer");
  if (solution.status() == v1::STATUS_SOLVED) {
    // The better of two branches: min ½z₀² + az₀ over z₀ ≥ 0, and min ½z₁² − z₁ over z₁ ≥ 0.
    const double a = std::max(0.0, -known.gradient), best = std::min(-0.5 * a * a, -0.5);
    expect(std::abs(solution.objective() - best) < 1e-6,
           "the answer of " + known.id + " is that of another job");
  } else {
    expect(known.cancelled || known.deleted, "job " + known.id + " is not solved");
  }
  return same(known,
              "status " + std::to_string(solution.status()) + " " + std::to_string(solution.objective()));
}

// What was answered while nothing could be written ends with the server, which then solves it again.
void Judge::forget_unwritten(Known& known) {
  if (known.unwritten_at < 0 || known.unwritten_at == lives()) return;
  known.unwritten_at = -1;
  known.ended = false;
  known.answer.clear();
}

bool Judge::same(Known& known, const std::string& answer) {
  if (known.answer.empty() && (full_ || full_changes_ != known.full_changes)) known.unwritten_at = lives();
  expect(known.answer.empty() || known.answer == answer,
         "the answer of " + known.id + " was '" + known.answer + "', and is '" + answer + "'");
  known.answer = answer;
  known.ended = true;
  return true;
}

void Judge::begins(std::string_view request_id) {
  const std::lock_guard lock(mutex_);
  const std::string id(request_id);
  if (over_.contains(id)) violated("job " + id + " begins after its cancellation or deletion was confirmed");
  if (id.starts_with(kFatal) && ++deaths_[id] > kStarts + lost_submits_[id])
    violated("job " + id + " is begun again, and has killed the server twice");
}

void Judge::submission_lost(const Known& known) {
  const std::lock_guard lock(mutex_);
  ++lost_submits_[known.request_id];
}

void Judge::is_over(const Known& known) {
  const std::lock_guard lock(mutex_);
  over_.insert(known.request_id);
}

void Judge::set_disk_full(bool full) {
  full_ = full;
  ++full_changes_;
}

void Judge::asks(Known& known) {
  forget_unwritten(known);
  known.full_changes = full_changes_;
}

}  // namespace marble::simulation
