#include "ramp.h"

#include <charconv>
#include <cmath>
#include <map>
#include <sstream>

namespace marble::load {
namespace {

constexpr double kKeepsUp = 0.95;  // of the offered rate; less means a growing queue
constexpr double kFewest = 10.0;   // requests of a run: fewer are not significant

std::string ms(double seconds) {
  std::ostringstream text;
  text.precision(4);
  text << 1e3 * seconds << " ms";
  return text.str();
}

}  // namespace

Expected<Objective> parse_objective(const std::string& text) {
  const auto wrong = [&] {
    return unexpected(
        invalid("--objective", "\"" + text + "\"", "must be pQ=TIME, as p99=50ms, p99.9=1s or p50=800us"));
  };
  Objective objective{0.0, 0.0, text};
  const char* const end = text.data() + text.size();
  if (text.empty() || text[0] != 'p') return wrong();
  const auto [after_part, part_error] = std::from_chars(text.data() + 1, end, objective.part);
  if (part_error != std::errc() || after_part == end || *after_part != '=') return wrong();
  const auto [after_time, time_error] = std::from_chars(after_part + 1, end, objective.most_s);
  if (time_error != std::errc()) return wrong();
  const std::string unit(after_time, end);
  const std::map<std::string, double> units = {{"s", 1.0}, {"ms", 1e-3}, {"us", 1e-6}};
  const auto found = units.find(unit);
  if (found == units.end()) return wrong();
  objective.part /= 100.0;
  objective.most_s *= found->second;
  if (!(objective.part > 0.0 && objective.part <= 1.0 && objective.most_s > 0.0)) return wrong();
  return objective;
}

std::string why_not(const RunResult& result, const RampPlan& plan) {
  const EntryTally sum = result.tally.sum();
  const auto sent = static_cast<double>(result.sent);
  if (result.sent == 0) return "nothing was sent: the duration is too short for the rate";
  const auto failures = static_cast<double>(result.failures());
  if (failures > plan.most_errors * sent) return std::to_string(result.failures()) + " requests failed";
  const double value_s = 1e-9 * static_cast<double>(sum.latency.quantile(plan.objective.part));
  if (value_s > plan.objective.most_s)
    return "latency was " + ms(value_s) + (result.lagged ? ", but the load tester itself sent late" : "");
  const double under_way = 1.0 + result.plan.rate_per_s * plan.objective.most_s;  // by Little's law
  if (static_cast<double>(result.answers_while_measured) + under_way < kKeepsUp * sent)
    return "answers did not keep up with requests";
  if (result.in_flight_limit) return "as many requests as --in-flight allows were under way";
  return "";
}

Expected<RampResult> ramp(const RunParts& parts, const Plan& plan, const RampPlan& limits,
                          const std::stop_token& stop, const std::function<void(const RampStep&)>& reported) {
  RampResult result;
  double holds = 0.0, fails = 0.0, rate = limits.first_rate_per_s;
  for (int step = 0; step < limits.most_steps; ++step) {
    Plan one = plan;
    one.rate_per_s = rate;
    MARBLE_ASSIGN_OR_RETURN(auto measured, run(parts, one, stop));
    if (measured.ending == Ending::interrupted) break;
    RampStep done{rate, false, why_not(measured, limits), std::move(measured)};
    done.holds = done.why_not.empty();
    (done.holds ? holds : fails) = rate;
    if (reported) reported(done);
    result.steps.push_back(std::move(done));
    if (holds > 0.0 && fails > 0.0) {
      if (fails <= holds * (1.0 + limits.precision)) break;
      rate = std::sqrt(holds * fails);
    } else {
      rate *= holds > 0.0 ? 2.0 : 0.5;
      if (rate * plan.duration_s < kFewest) break;
    }
  }
  result.best_rate_per_s = holds;
  return result;
}

Expected<OverloadResult> overload(const RunParts& parts, const Plan& plan, const std::vector<double>& levels,
                                  int workers, const std::stop_token& stop,
                                  const std::function<void(const OverloadStep&)>& reported) {
  OverloadResult result;
  Plan closed = plan;
  closed.loop = Loop::closed;
  closed.clients = 2 * workers;
  MARBLE_ASSIGN_OR_RETURN(auto capacity, run(parts, closed, stop));
  result.capacity_per_s = capacity.answers_per_s;
  for (const double level : levels) {
    if (stop.stop_requested() || result.capacity_per_s <= 0.0) break;
    Plan one = plan;
    one.loop = Loop::open;
    one.rate_per_s = level * result.capacity_per_s;
    MARBLE_ASSIGN_OR_RETURN(auto measured, run(parts, one, stop));
    result.steps.push_back({level, result.capacity_per_s, std::move(measured)});
    if (reported) reported(result.steps.back());
  }
  return result;
}

}  // namespace marble::load
