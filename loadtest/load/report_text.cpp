#include <cstdarg>
#include <cstdio>

#include "report.h"

namespace marble::load {
namespace {

[[gnu::format(printf, 1, 2)]] std::string text(const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  char buffer[512];
  const int length = std::vsnprintf(buffer, sizeof buffer, format, arguments);
  va_end(arguments);
  return length > 0 ? std::string(buffer) : std::string();
}

double ms(std::int64_t ns) { return 1e-6 * static_cast<double>(ns); }

std::string row(const char* name, const Histogram& h) {
  if (h.count() == 0) return "";
  std::string line = text("  %-22s", name);
  for (const double part : shown_parts()) line += text(" %9.3f", ms(h.quantile(part)));
  return line + text(" %9.3f %9.3f\n", ms(h.most()), 1e-6 * h.mean());
}

std::string times(const EntryTally& tally, const Histogram* lag) {
  std::string out = text("  %-22s %9s %9s %9s %9s %9s %9s %9s %9s %9s\n", "milliseconds", "p50", "p75", "p90",
                         "p95", "p99", "p99.9", "p99.99", "max", "mean");
  out += row("latency", tally.latency);
  out += row("  outside the server", tally.outside);
  out += row("  server: queue", tally.queue);
  out += row("  server: solve", tally.solve);
  out += row("errors came after", tally.refusal);
  if (lag != nullptr) out += row("sent late by", *lag);
  return out;
}

template <class Map>
std::string counts(const Map& map) {
  std::string out;
  for (const auto& [name, count] : map) out += (out.empty() ? "" : ", ") + name + " " + std::to_string(count);
  return out.empty() ? "none" : out;
}

std::string plan_line(const Plan& plan) {
  std::string out = plan.loop == Loop::open
                        ? text("open loop, %g requests/s, %s arrivals, %d clients", plan.rate_per_s,
                               plan.arrivals == ArrivalProcess::fixed ? "fixed" : "Poisson", plan.clients)
                        : text("closed loop, %d clients", plan.clients);
  return out + text(" on %d connections, %s", plan.connections, to_string(plan.mode));
}

std::string warnings(const RunResult& r) {
  std::string out;
  if (r.ending == Ending::interrupted) out += "! interrupted: this is the part that was measured\n";
  if (r.lagged)
    out +=
        "! the load tester sent late (p99 of \"sent late by\"): it, or a lack of processors for it, was a "
        "bottleneck\n";
  if (r.in_flight_limit)
    out += "! sending waited at times: as many requests as --in-flight allows were under way\n";
  if (r.check.let_go > 0)
    out += text("! %llu answers due to be checked were not: the checks did not keep up\n",
                static_cast<unsigned long long>(r.check.let_go));
  if (r.abandoned > 0)
    out += text("! %llu requests were given up unanswered\n", static_cast<unsigned long long>(r.abandoned));
  if (!r.check.first_fault.empty()) out += "! wrong answer: " + r.check.first_fault + "\n";
  for (const auto& [code, message] : r.tally.messages)
    out += "! " + code + ": " + message.substr(0, 300) + "\n";
  return out;
}

}  // namespace

std::string text_report(const Subject& subject, const RunResult& r) {
  const EntryTally sum = r.tally.sum();
  std::string out = text("marble-load: %s, server %s with %d workers\n", subject.address.c_str(),
                         subject.server_version.c_str(), subject.workers);
  out += plan_line(r.plan) + text("; %.1f s after %g s of warm-up\n\n", r.measured_s, r.plan.warm_up_s);
  out += times(sum, r.plan.loop == Loop::open ? &r.tally.lag : nullptr);
  if (subject.entries.size() > 1) {
    for (std::size_t i = 0; i < subject.entries.size(); ++i) {
      const EntryTally& entry = r.tally.entries[i];
      out += text("\n%s: %llu answers, errors: %s\n", subject.entries[i].c_str(),
                  static_cast<unsigned long long>(entry.answers), counts(entry.errors).c_str());
      out += times(entry, nullptr);
    }
  }
  out += text("\n  sent      %llu requests\n  answers   %llu (%s); %.2f a second\n",
              static_cast<unsigned long long>(r.sent), static_cast<unsigned long long>(sum.answers),
              counts(sum.statuses).c_str(), r.answers_per_s);
  out += text("  errors    %s; %llu of them with RetryInfo\n", counts(sum.errors).c_str(),
              static_cast<unsigned long long>(sum.with_retry_info));
  out += text("  checked   %llu answers, %llu wrong\n", static_cast<unsigned long long>(r.check.checked),
              static_cast<unsigned long long>(r.check.wrong_count()));
  if (sum.progress_rows > 0)
    out += text("  progress  %llu rows, %llu skipped\n", static_cast<unsigned long long>(sum.progress_rows),
                static_cast<unsigned long long>(sum.progress_skipped));
  out += text("  CPU       server %.3f ms an answer, load %.3f ms an answer\n",
              1e3 * r.cpu_per_answer_s(r.server_cpu_s), 1e3 * r.cpu_per_answer_s(r.load_cpu_s));
  const std::string notes = warnings(r);
  return notes.empty() ? out : out + "\n" + notes;
}

std::string text_line(const RampStep& step, const Objective& objective) {
  const EntryTally sum = step.result.tally.sum();
  return text("%12.2f %12.2f %12.3f %12.3f %9llu  %s\n", step.rate_per_s, step.result.answers_per_s,
              ms(sum.latency.quantile(0.5)), ms(sum.latency.quantile(objective.part)),
              static_cast<unsigned long long>(step.result.failures()),
              step.holds ? "holds" : step.why_not.c_str());
}

namespace {

std::uint64_t errors_of(const EntryTally& tally, const char* code) {
  const auto found = tally.errors.find(code);
  return found == tally.errors.end() ? 0 : found->second;
}

std::uint64_t other_failures(const RunResult& result, const EntryTally& sum) {
  return result.failures() - errors_of(sum, "resource_exhausted") - errors_of(sum, "deadline_exceeded");
}

}  // namespace

std::string text_line(const OverloadStep& step) {
  const EntryTally sum = step.result.tally.sum();
  return text("%6.2f %11.1f %11.1f %9.2f %8.2f %9.3f %9.3f %9llu %9llu %9llu\n", step.level,
              step.result.plan.rate_per_s, step.result.answers_per_s, step.goodput(), step.useful(),
              ms(sum.latency.quantile(0.5)), ms(sum.latency.quantile(0.99)),
              static_cast<unsigned long long>(errors_of(sum, "resource_exhausted")),
              static_cast<unsigned long long>(errors_of(sum, "deadline_exceeded")),
              static_cast<unsigned long long>(other_failures(step.result, sum)));
}

std::string text_report(const Subject& subject, const OverloadResult& result) {
  std::string out =
      text("marble-load overload: %s, server %s with %d workers; capacity %.1f answers/s\n\n",
           subject.address.c_str(), subject.server_version.c_str(), subject.workers, result.capacity_per_s);
  out += text("%6s %11s %11s %9s %8s %9s %9s %9s %9s %9s\n", "level", "offered/s", "answers/s", "goodput",
              "useful", "p50, ms", "p99, ms", "refused", "late", "failures");
  for (const OverloadStep& step : result.steps) out += text_line(step);
  for (const OverloadStep& step : result.steps) {
    if (!step.result.check.first_fault.empty())
      out += "! wrong answer: " + step.result.check.first_fault + "\n";
    if (step.result.lagged) out += text("! at level %g the load tester sent late\n", step.level);
  }
  return out;
}

std::string csv_report(const OverloadResult& result) {
  std::string out =
      "level,offered_per_s,answers_per_s,goodput,useful,p50_s,p99_s,sent,refused,late,failures\n";
  for (const OverloadStep& step : result.steps) {
    const EntryTally sum = step.result.tally.sum();
    out += text("%g,%.6g,%.6g,%.4f,%.4f,%.6g,%.6g,%llu,%llu,%llu,%llu\n", step.level,
                step.result.plan.rate_per_s, step.result.answers_per_s, step.goodput(), step.useful(),
                1e-3 * ms(sum.latency.quantile(0.5)), 1e-3 * ms(sum.latency.quantile(0.99)),
                static_cast<unsigned long long>(step.result.sent),
                static_cast<unsigned long long>(errors_of(sum, "resource_exhausted")),
                static_cast<unsigned long long>(errors_of(sum, "deadline_exceeded")),
                static_cast<unsigned long long>(other_failures(step.result, sum)));
  }
  return out;
}

std::string text_report(const Subject& subject, const RampResult& result, const Objective& objective) {
  std::string out =
      text("marble-load ramp: %s, server %s with %d workers, objective %s\n\n", subject.address.c_str(),
           subject.server_version.c_str(), subject.workers, objective.text.c_str());
  out += text("%12s %12s %12s %12s %9s\n", "offered/s", "answers/s", "median, ms",
              (objective.quantile() + ", ms").c_str(), "failures");
  for (const RampStep& step : result.steps) out += text_line(step, objective);
  if (result.best_rate_per_s > 0.0) {
    out += text("\nhighest rate that holds: %.2f requests/s\n", result.best_rate_per_s);
  } else {
    out += "\nno rate held the objective\n";
  }
  for (const RampStep& step : result.steps) {
    if (!step.result.check.first_fault.empty())
      out += "! wrong answer: " + step.result.check.first_fault + "\n";
  }
  return out;
}

}  // namespace marble::load
