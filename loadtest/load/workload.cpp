#include "workload.h"

#include <utility>

#include "marble/convert.h"
#include "marble/v1/service.pb.h"

namespace marble::load {
namespace {

grpc::ByteBuffer bytes_of(const google::protobuf::MessageLite& message) {
  const grpc::Slice slice(message.SerializeAsString());
  return {&slice, 1};
}

void fill(const Entry& entry, const OwnedProblem& problem, v1::SolveRequest* request) {
  to_message(problem.view(), request->mutable_problem());
  request->mutable_problem()->set_name(entry.name);
  to_message(entry.options, request->mutable_options());
  request->mutable_initial_point()->mutable_z()->Assign(problem.initial_z.begin(), problem.initial_z.end());
  request->set_priority(static_cast<v1::Priority>(static_cast<int>(entry.priority)));
}

grpc::ByteBuffer setup_of(const Entry& entry, const OwnedProblem& problem) {
  v1::SolveRequest request;
  fill(entry, problem, &request);
  v1::SessionRequest message;
  v1::SessionSetup& setup = *message.mutable_setup();
  *setup.mutable_problem() = std::move(*request.mutable_problem());
  *setup.mutable_options() = std::move(*request.mutable_options());
  *setup.mutable_initial_point() = std::move(*request.mutable_initial_point());
  setup.set_priority(request.priority());
  return bytes_of(message);
}

using Values = google::protobuf::RepeatedField<double>;

// Sends every part that differs between any two variants for all, whatever was sent before.
template <class Part>
void add_changes(const std::vector<OwnedProblem>& all, const OwnedProblem& problem, Part part, Values* to) {
  for (const OwnedProblem& other : all) {
    if (part(other) == part(all.front())) continue;
    to->Assign(part(problem).begin(), part(problem).end());
    return;
  }
}

grpc::ByteBuffer update_of(const Entry& entry, const std::vector<OwnedProblem>& all, const OwnedProblem& p) {
  v1::SessionRequest message;
  v1::SessionUpdate& update = *message.mutable_update();
  update.set_cold(entry.cold);
  update.set_deadline_s(entry.deadline_s);
  v1::ProblemUpdate* changed = update.mutable_problem();
  using P = const OwnedProblem&;
  changed->set_constant(p.c0);
#define MARBLE_VECTOR(letter, field) \
  add_changes(                       \
      all, p, [](P x) -> auto& { return x.letter; }, changed->mutable_##field());
#define MARBLE_MATRIX(letter, field, update, vector) \
  add_changes(                                       \
      all, p, [](P x) -> auto& { return x.letter.values; }, changed->mutable_##update());
#include "marble/contract.def"
  return bytes_of(message);
}

grpc::ByteBuffer request_of(const LoadedEntry& loaded, const OwnedProblem& problem) {
  if (loaded.mode == Mode::session) return update_of(loaded.entry, loaded.problems, problem);
  if (loaded.mode == Mode::streamed) {
    v1::SolveStreamRequest request;
    fill(loaded.entry, problem, request.mutable_solve());
    request.set_progress_interval_s(loaded.entry.progress_interval_s);
    return bytes_of(request);
  }
  if (loaded.mode == Mode::batch) {
    v1::SolveBatchRequest request;
    fill(loaded.entry, problem, request.mutable_solve());
    return bytes_of(request);
  }
  v1::SolveRequest request;
  fill(loaded.entry, problem, &request);
  return bytes_of(request);
}

}  // namespace

Expected<std::vector<LoadedEntry>> load(const Scenario& scenario, Mode mode) {
  std::vector<LoadedEntry> result;
  for (const Entry& entry : scenario.entries) {
    MARBLE_ASSIGN_OR_RETURN(auto problems, problems_of(entry));
    LoadedEntry loaded{entry, entry.mode.value_or(mode), std::move(problems), {}, {}};
    if (loaded.mode == Mode::session) loaded.setup = setup_of(entry, loaded.problems.front());
    for (const OwnedProblem& problem : loaded.problems)
      loaded.requests.push_back(request_of(loaded, problem));
    result.push_back(std::move(loaded));
  }
  return result;
}

grpc::ByteBuffer merged(const grpc::ByteBuffer& message, const std::string& addition) {
  std::vector<grpc::Slice> slices;
  static_cast<void>(message.Dump(&slices));
  slices.emplace_back(addition);
  return {slices.data(), slices.size()};
}

}  // namespace marble::load
