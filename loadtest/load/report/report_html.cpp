#include <sstream>

#include "report/report.h"
#include "report/svg_plot.h"

namespace marble::load {
namespace {

constexpr std::size_t kMostPoints = 600;  // of a line: more points than pixels are useless

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --back: #ffffff; --text: #1d2228; --faint: #d8dde3; --soft: #5d6772;
        --s0: #0b62c4; --s1: #c2410c; --s2: #15803d; --s3: #7e22ce; --s4: #a16207; --s5: #0e7490; }
@media (prefers-color-scheme: dark) {
  :root { --back: #14181d; --text: #e6eaee; --faint: #333b44; --soft: #9aa5b1;
          --s0: #6cb0ff; --s1: #ff9a62; --s2: #5fd08a; --s3: #c79bff; --s4: #e3c04d; --s5: #5fcde4; }
}
body { background: var(--back); color: var(--text); font: 15px/1.45 system-ui, sans-serif; max-width: 60rem;
       margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.4rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
svg { width: 100%; height: auto; margin: 1rem 0; }
svg text { fill: var(--soft); font: 11px system-ui, sans-serif; }
svg .title { fill: var(--text); font-size: 14px; font-weight: 600; } svg .axis { font-size: 12px; }
svg .grid { stroke: var(--faint); stroke-width: 1; }
svg polyline, svg line { fill: none; stroke-width: 2; }
svg .s0 { stroke: var(--s0); } svg .s1 { stroke: var(--s1); } svg .s2 { stroke: var(--s2); }
svg .s3 { stroke: var(--s3); } svg .s4 { stroke: var(--s4); } svg .s5 { stroke: var(--s5); }
svg .m0 { fill: var(--s0); } svg .m1 { fill: var(--s1); } svg .m2 { fill: var(--s2); }
svg .m3 { fill: var(--s3); } svg .m4 { fill: var(--s4); } svg .m5 { fill: var(--s5); }
pre { overflow-x: auto; padding: .8rem; border: 1px solid var(--faint); border-radius: 6px; font-size: 13px; }
)";

std::string page(const std::string& title, const Subject& subject, const std::string& body) {
  std::ostringstream out;
  out << "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      << "<meta name=\"viewport\" content=\"width=device-width\">\n<title>" << escaped(title)
      << "</title>\n<style>" << kStyle << "</style>\n</head>\n<body>\n<h1>" << escaped(title) << "</h1>\n<p>"
      << subject.machine.cores << " cores, " << escaped(subject.machine.processor) << ", "
      << escaped(subject.machine.system) << "</p>\n<pre>" << escaped(subject.command) << "</pre>\n"
      << body << "</body>\n</html>\n";
  return out.str();
}

Series distribution(const std::string& name, const Histogram& histogram) {
  Series series{name, {}, true, false};
  const auto steps = histogram.steps();
  const std::size_t stride = 1 + steps.size() / kMostPoints;
  double before = 0.0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    // The tail is drawn in full: the plot is about it.
    if (i % stride == 0 || steps[i].part > 0.99)
      series.points.emplace_back(1e-6 * static_cast<double>(steps[i].value), before);
    before = steps[i].part;
  }
  return series;
}

std::string distribution_plot(const EntryTally& tally) {
  return svg_plot(
      "Latency: the part of the answers within a time", {"milliseconds", Scale::logarithmic},
      {"part of the answers", Scale::nines},
      {distribution("from the intended time", tally.latency), distribution("server: solve", tally.solve),
       distribution("server: queue", tally.queue), distribution("outside the server", tally.outside)});
}

Series over_time(const char* name, const RunResult& result, double (*value)(const Second&)) {
  Series series{name, {}, true, false};
  for (const Second& second : result.seconds) series.points.emplace_back(second.at_s, value(second));
  return series;
}

std::string time_plots(const RunResult& r) {
  const Axis time{"seconds since the warm-up", Scale::linear};
  std::string out = svg_plot("Latency over time", time, {"milliseconds", Scale::logarithmic},
                             {over_time("median", r, [](const Second& s) { return 1e3 * s.p50_s; }),
                              over_time("p99", r, [](const Second& s) { return 1e3 * s.p99_s; }),
                              over_time("longest", r, [](const Second& s) { return 1e3 * s.most_s; })});
  out += svg_plot("Answers over time", time, {"a second", Scale::linear},
                  {over_time("answers", r, [](const Second& s) { return static_cast<double>(s.answers); }),
                   over_time("errors", r, [](const Second& s) { return static_cast<double>(s.errors); })});
  out += svg_plot(
      "The server over time", time, {"", Scale::linear},
      {over_time("jobs in the queue", r, [](const Second& s) { return static_cast<double>(s.queued); }),
       over_time("memory, MiB", r,
                 [](const Second& s) { return static_cast<double>(s.resident_bytes) / 1048576.0; })});
  return out;
}

std::string preformatted(const std::string& text) { return "<pre>" + escaped(text) + "</pre>\n"; }

Series steps_of(const char* name, const RampResult& result, bool holding, double (*value)(const RampStep&)) {
  Series series{name, {}, false, true};
  for (const RampStep& step : result.steps) {
    if (step.holds == holding) series.points.emplace_back(step.rate_per_s, value(step));
  }
  return series;
}

}  // namespace

std::string html_report(const Subject& subject, const RunResult& result) {
  return page("Marble under load", subject,
              preformatted(text_report(subject, result)) + distribution_plot(result.tally.sum()) +
                  time_plots(result));
}

std::string html_report(const Subject& subject, const RampResult& result, const Objective& objective) {
  const Axis offered{"offered requests a second", Scale::linear};
  const auto answers = [](const RampStep& s) { return s.result.answers_per_s; };
  std::string body = preformatted(text_report(subject, result, objective));
  body += svg_plot("Throughput against offered load", offered, {"answers a second", Scale::linear},
                   {steps_of("holds", result, true, answers), steps_of("does not", result, false, answers)});
  const auto latency_ms = [](const RampStep& step, double part) {
    return 1e-6 * static_cast<double>(step.result.tally.sum().latency.quantile(part));
  };
  Series median{"median", {}, false, true}, judged{objective.quantile(), {}, false, true};
  Series limit{"objective " + objective.text, {}, true, false};
  for (const RampStep& step : result.steps) {
    median.points.emplace_back(step.rate_per_s, latency_ms(step, 0.5));
    judged.points.emplace_back(step.rate_per_s, latency_ms(step, objective.part));
    limit.points.emplace_back(step.rate_per_s, 1e3 * objective.most_s);
  }
  body += svg_plot("Latency against offered load", offered, {"milliseconds", Scale::logarithmic},
                   {median, judged, limit});
  for (const RampStep& step : result.steps) {
    std::ostringstream heading;
    heading << "<h2>" << step.rate_per_s << " requests a second</h2>\n";
    body += heading.str() + preformatted(text_report(subject, step.result)) +
            distribution_plot(step.result.tally.sum());
  }
  return page("Marble under rising load", subject, body);
}

}  // namespace marble::load
