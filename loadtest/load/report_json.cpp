#include <algorithm>
#include <cmath>

#include "report.h"

namespace marble::load {
namespace {

constexpr const char* kSchema = "marble-load/1";

double s(std::int64_t ns) { return 1e-9 * static_cast<double>(ns); }

Json distribution(const Histogram& h) {
  Json json = {{"count", h.count()}, {"mean_s", 1e-9 * h.mean()}, {"least_s", s(h.least())}};
  for (const double part : shown_parts()) {
    std::string name = "p" + std::to_string(100.0 * part);
    name.erase(name.find_last_not_of('0') + 1);
    if (name.back() == '.') name.pop_back();
    json[name + "_s"] = s(h.quantile(part));
  }
  json["most_s"] = s(h.most());
  return json;
}

Json entry_json(const EntryTally& tally) {
  return {{"answers", tally.answers},
          {"statuses", tally.statuses},
          {"errors", tally.errors},
          {"errors_with_retry_info", tally.with_retry_info},
          {"progress_rows", tally.progress_rows},
          {"progress_skipped", tally.progress_skipped},
          {"latency", distribution(tally.latency)},
          {"service", distribution(tally.service)},
          {"server_queue", distribution(tally.queue)},
          {"server_solve", distribution(tally.solve)},
          {"outside_server", distribution(tally.outside)},
          {"errors_after", distribution(tally.refusal)}};
}

// For plots: points [seconds, part of all values up to them] at even distances on an axis of nines (0, 90 %,
// 99 %, ...), so that the tail is as fine as the rest, and at most some 450.
Json cumulative(const Histogram& h) {
  constexpr double kPointsPerNine = 50.0, kMostNines = 9.0;
  Json points = Json::array();
  double next = 0.0;
  for (const Histogram::Step& step : h.steps()) {
    const double nines = std::min(kMostNines, -std::log10(std::max(1e-12, 1.0 - step.part)));
    if (nines < next && step.part < 1.0) continue;
    next = nines + 1.0 / kPointsPerNine;
    points.push_back(Json::array({s(step.value), step.part}));
  }
  return points;
}

Json total_json(const EntryTally& sum) {
  Json json = entry_json(sum);
  json["latency"]["cumulative"] = cumulative(sum.latency);
  json["server_queue"]["cumulative"] = cumulative(sum.queue);
  json["server_solve"]["cumulative"] = cumulative(sum.solve);
  json["outside_server"]["cumulative"] = cumulative(sum.outside);
  return json;
}

Json plan_json(const Plan& plan) {
  Json json = {{"loop", plan.loop == Loop::open ? "open" : "closed"},
               {"mode", to_string(plan.mode)},
               {"clients", plan.clients},
               {"connections", plan.connections}};
  if (plan.loop == Loop::open) {
    json["rate_per_s"] = plan.rate_per_s;
    json["arrivals"] = plan.arrivals == ArrivalProcess::fixed ? "fixed" : "poisson";
    json["in_flight"] = plan.in_flight;
  }
  json["warm_up_s"] = plan.warm_up_s;
  if (plan.count > 0) {
    json["count"] = plan.count;
  } else {
    json["duration_s"] = plan.duration_s;
  }
  json["check"] = plan.check;
  json["seed"] = plan.seed;
  return json;
}

Json counters_json(const ServerInfo& before, const ServerInfo& after) {
  return {{"accepted", after.accepted - before.accepted}, {"answered", after.answered - before.answered},
          {"refused", after.refused - before.refused},    {"cancelled", after.cancelled - before.cancelled},
          {"failed", after.failed - before.failed},       {"updates", after.updates - before.updates},
          {"busy_s", after.busy_s - before.busy_s}};
}

Json run_json(const Subject& subject, const RunResult& r) {
  Json entries = Json::object();
  for (std::size_t i = 0; i < subject.entries.size(); ++i)
    entries[subject.entries[i]] = entry_json(r.tally.entries[i]);
  Json seconds = Json::array();
  for (const Second& second : r.seconds) {
    seconds.push_back({{"at_s", second.at_s},
                       {"answers", second.answers},
                       {"errors", second.errors},
                       {"p50_s", second.p50_s},
                       {"p99_s", second.p99_s},
                       {"most_s", second.most_s},
                       {"queued", second.queued},
                       {"running", second.running},
                       {"resident_bytes", second.resident_bytes}});
  }
  return {{"plan", plan_json(r.plan)},
          {"ending", r.ending == Ending::complete ? "complete" : "interrupted"},
          {"measured_s", r.measured_s},
          {"sent", r.sent},
          {"answers_per_s", r.answers_per_s},
          {"answers_while_measured", r.answers_while_measured},
          {"errors_while_measured", r.errors_while_measured},
          {"abandoned", r.abandoned},
          {"checked", r.check.checked},
          {"check_let_go", r.check.let_go},
          {"wrong", r.check.wrong_count()},
          {"first_fault", r.check.first_fault},
          {"server_cpu_s", r.server_cpu_s},
          {"server_cpu_per_answer_s", r.cpu_per_answer_s(r.server_cpu_s)},
          {"load_cpu_s", r.load_cpu_s},
          {"load_cpu_per_answer_s", r.cpu_per_answer_s(r.load_cpu_s)},
          {"lagged", r.lagged},
          {"in_flight_limit_reached", r.in_flight_limit},
          {"lag", distribution(r.tally.lag)},
          {"total", total_json(r.tally.sum())},
          {"entries", std::move(entries)},
          {"error_messages", r.tally.messages},
          {"server_counters", counters_json(r.before, r.after)},
          {"seconds", std::move(seconds)}};
}

Json head(const Subject& subject, const char* kind) {
  return {{"schema", kSchema},
          {"kind", kind},
          {"command", subject.command},
          {"server",
           {{"address", subject.address}, {"version", subject.server_version}, {"workers", subject.workers}}},
          {"machine",
           {{"processor", subject.machine.processor},
            {"cores", subject.machine.cores},
            {"memory_bytes", subject.machine.memory_bytes},
            {"system", subject.machine.system}}}};
}

}  // namespace

const std::vector<double>& shown_parts() {
  static const std::vector<double> parts = {0.5, 0.75, 0.9, 0.95, 0.99, 0.999, 0.9999};
  return parts;
}

Json json_report(const Subject& subject, const RunResult& result) {
  Json json = head(subject, "run");
  json["run"] = run_json(subject, result);
  return json;
}

Json json_report(const Subject& subject, const OverloadResult& result) {
  Json json = head(subject, "overload");
  json["capacity_per_s"] = result.capacity_per_s;
  json["steps"] = Json::array();
  for (const OverloadStep& step : result.steps) {
    json["steps"].push_back({{"level", step.level},
                             {"goodput", step.goodput()},
                             {"useful", step.useful()},
                             {"run", run_json(subject, step.result)}});
  }
  return json;
}

Json json_report(const Subject& subject, const RampResult& result, const Objective& objective) {
  Json json = head(subject, "ramp");
  json["objective"] = {{"text", objective.text}, {"part", objective.part}, {"most_s", objective.most_s}};
  json["best_rate_per_s"] = result.best_rate_per_s;
  json["steps"] = Json::array();
  for (const RampStep& step : result.steps) {
    json["steps"].push_back({{"rate_per_s", step.rate_per_s},
                             {"holds", step.holds},
                             {"why_not", step.why_not},
                             {"latency_s", s(step.result.tally.sum().latency.quantile(objective.part))},
                             {"run", run_json(subject, step.result)}});
  }
  return json;
}

}  // namespace marble::load
