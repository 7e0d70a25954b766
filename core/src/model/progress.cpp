#include "marble/progress.h"

#include <algorithm>
#include <cmath>

#include "model/text_of.h"

namespace marble {
namespace {

const char* in_words(Phase phase) {
  switch (phase) {
    case Phase::setup:
      return "set-up";
    case Phase::path:
      return "path";
    case Phase::local_search:
      return "local search";
    case Phase::starts:
      return "further starts";
    case Phase::tree:
      return "branch and bound";
    case Phase::feasibility:
      return "search for a feasible point";
    case Phase::scenarios:
      return "scenarios";
    case Phase::coupled:
      return "coupled blocks";
    case Phase::conflict:
      return "conflict";
  }
  return "?";
}

const char* unit_of(Phase phase) {
  switch (phase) {
    case Phase::tree:
    case Phase::feasibility:
      return " nodes";
    case Phase::coupled:
      return " iterations";
    case Phase::conflict:
      return " parts needed";
    default:
      return "";
  }
}

}  // namespace

const char* to_string(Phase phase) {
  switch (phase) {
    case Phase::setup:
      return "setup";
    case Phase::path:
      return "path";
    case Phase::local_search:
      return "local_search";
    case Phase::starts:
      return "starts";
    case Phase::tree:
      return "tree";
    case Phase::feasibility:
      return "feasibility";
    case Phase::scenarios:
      return "scenarios";
    case Phase::coupled:
      return "coupled";
    case Phase::conflict:
      return "conflict";
  }
  return "?";
}

std::string describe(const Activity& activity) {
  std::string text = in_words(activity.phase);
  const char* before = ": ";
  const auto add = [&](const std::string& part) {
    text += before + part;
    before = ", ";
  };
  if (activity.total > 0) {
    add(std::to_string(activity.done) + " of " + std::to_string(activity.total) + unit_of(activity.phase));
  } else if (activity.done > 0) {
    add(std::to_string(activity.done) + unit_of(activity.phase));
  }
  if (std::isfinite(activity.incumbent)) add("best " + general(activity.incumbent, 6));
  if (std::isfinite(activity.gap)) add("gap " + scientific(activity.gap, 1));
  return text;
}

Activity ActivityMonitor::read() const {
  const std::scoped_lock lock(mutex_);
  return activity_;
}

void ActivityMonitor::begin() {
  const std::scoped_lock lock(mutex_);
  activity_ = {};
  depth_ = 0;
  changed();
}

void ActivityMonitor::enter(Phase phase, std::int64_t total) {
  const std::scoped_lock lock(mutex_);
  if (depth_++ > 0) return;
  activity_.phase = phase;
  activity_.done = 0;
  activity_.total = total;
  changed();
}

void ActivityMonitor::leave() {
  const std::scoped_lock lock(mutex_);
  --depth_;
}

void ActivityMonitor::set_done(Phase phase, std::int64_t done, std::int64_t total) {
  const std::scoped_lock lock(mutex_);
  if (activity_.phase != phase) return;
  activity_.done = done;
  activity_.total = total;
  changed();
}

void ActivityMonitor::add_incumbent(double objective) {
  const std::scoped_lock lock(mutex_);
  activity_.incumbent = std::min(activity_.incumbent, objective);
  changed();
}

void ActivityMonitor::set_gap(double gap) {
  const std::scoped_lock lock(mutex_);
  activity_.gap = gap;
  changed();
}

void ActivityMonitor::set(const Activity& activity) {
  const std::scoped_lock lock(mutex_);
  activity_ = activity;
  changed();
}

}  // namespace marble
