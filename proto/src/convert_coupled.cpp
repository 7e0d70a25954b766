#include "marble/convert_coupled.h"

#include <string_view>

#include "marble/convert.h"

namespace marble {
namespace {

constexpr std::string_view kCoupled = "coupled.", kSegments = "segments.", kStart = "start.",
                           kProblem = ".problem.";

// Renames the last part of a path such as "blocks[3].problem.A".
template <class Rename>
std::string renamed(const std::string& field, const Rename& rename) {
  const std::size_t at = field.find(kProblem);
  if (!field.starts_with("blocks[") || at == std::string::npos) return field;
  const std::size_t end = at + kProblem.size();
  return field.substr(0, end) + rename(field.substr(end));
}

bool of_segments(const std::string& field) {
  return field == "stages" || field == "num_segments" || field == "overlap";
}

}  // namespace

CoupledView coupled_of(const v1::Coupled& message) {
  CoupledView view{{},
                   {message.coupling_rhs().data(), static_cast<std::size_t>(message.coupling_rhs_size())}};
  view.blocks.reserve(static_cast<std::size_t>(message.blocks_size()));
  for (const v1::CoupledBlock& block : message.blocks()) {
    CoupledBlock& own = view.blocks.emplace_back();
    own.name = block.problem().name();
    own.problem = view_of(block.problem());
    if (block.has_coupling()) own.coupling = view_of(block.coupling());
  }
  return view;
}

void to_message(const CoupledView& view, v1::Coupled* message) {
  for (const CoupledBlock& block : view.blocks) {
    v1::CoupledBlock* own = message->add_blocks();
    to_message(block.problem, own->mutable_problem());
    own->mutable_problem()->set_name(block.name);
    if (!block.coupling.values.empty()) to_message(block.coupling, own->mutable_coupling());
  }
  message->mutable_coupling_rhs()->Assign(view.coupling_rhs.begin(), view.coupling_rhs.end());
}

void take_settings(const v1::Coupled& message, CoupledOptions& settings) {
  if (message.has_proximal()) settings.proximal = message.proximal();
  if (message.has_max_iterations()) settings.max_iterations = message.max_iterations();
  if (message.has_freeze_after()) settings.freeze_after = message.freeze_after();
  if (message.has_max_searches()) settings.max_searches = message.max_searches();
  if (message.has_max_pair_switches()) settings.max_pair_switches = message.max_pair_switches();
  if (message.has_tolerance()) settings.tolerance = message.tolerance();
  if (message.has_monolithic()) settings.monolithic = message.monolithic();
  if (message.has_monolithic_search()) settings.monolithic_search = message.monolithic_search();
}

void to_message(const CoupledOptions& settings, v1::Coupled* message) {
  message->set_proximal(settings.proximal);
  message->set_max_iterations(settings.max_iterations);
  message->set_freeze_after(settings.freeze_after);
  message->set_max_searches(settings.max_searches);
  message->set_max_pair_switches(settings.max_pair_switches);
  message->set_tolerance(settings.tolerance);
  message->set_monolithic(settings.monolithic);
  message->set_monolithic_search(settings.monolithic_search);
}

void to_message(const Coordination& coordination, double blocks_objective, v1::CoupledOutcome* message) {
  message->set_status(to_message(coordination.status));
  message->set_detail(coordination.detail);
  message->set_iterations(coordination.last.iteration);
  message->set_coupling_violation(coordination.last.coupling_violation);
  message->set_step(coordination.last.step);
  message->set_proximal(coordination.last.proximal);
  message->set_frozen_at(coordination.frozen_at);
  message->set_pair_switches(coordination.pair_switches);
  message->set_factorizations(coordination.last.factorizations);
  message->set_blocks_objective(blocks_objective);
  if (coordination.failed_block)
    message->set_failed_block(static_cast<std::int32_t>(*coordination.failed_block));
  message->mutable_coupling_multipliers()->Assign(coordination.coupling_multipliers.begin(),
                                                  coordination.coupling_multipliers.end());
}

Coordination coordination_of(const v1::CoupledOutcome& message) {
  Coordination coordination;
  coordination.status = status_of(message.status());
  coordination.detail = message.detail();
  coordination.last.iteration = message.iterations();
  coordination.last.coupling_violation = message.coupling_violation();
  coordination.last.step = message.step();
  coordination.last.objective = message.blocks_objective();
  coordination.last.proximal = message.proximal();
  coordination.last.frozen = message.frozen_at() > 0;
  coordination.last.factorizations = message.factorizations();
  coordination.frozen_at = message.frozen_at();
  coordination.pair_switches = message.pair_switches();
  if (message.has_failed_block())
    coordination.failed_block = static_cast<std::size_t>(message.failed_block());
  coordination.coupling_multipliers.assign(message.coupling_multipliers().begin(),
                                           message.coupling_multipliers().end());
  return coordination;
}

std::string coupled_message_field(const std::string& core_field) {
  std::string field = renamed(core_field, [](const std::string& part) { return message_field(part); });
  if (of_segments(field)) field.insert(0, kSegments);
  if (field.starts_with(kStart)) field.erase(0, kStart.size());
  return std::string(kCoupled) + field;
}

std::string coupled_core_field(const std::string& message_field) {
  if (!message_field.starts_with(kCoupled)) return message_field;
  std::string field = message_field.substr(kCoupled.size());
  if (field.starts_with(kSegments)) field.erase(0, kSegments.size());
  if (field == "coupling_multipliers") field.insert(0, kStart);
  return renamed(field, [](const std::string& part) { return core_field(part); });
}

}  // namespace marble
