// A bundle on its way to another machine: the server solves its request, the bundle is written and read, and
// `marble replay` solves it again in this process: the same answer, bit for bit, or an error of the same
// kind. An input may also bring facts and an answer of its own, which are compared with the answer.
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <string>
#include <vector>

#include "bundle.h"
#include "expect.h"
#include "marble/client.h"
#include "marble/convert.h"
#include "replay/difference.h"
#include "replay/solve_request.h"
#include "requests/findings.h"
#include "requests/judge.h"
#include "requests/make.h"
#include "requests/mutate.h"
#include "requests/work.h"

using namespace marble;

namespace {

constexpr std::int64_t kMaxSampleSize = 12;
constexpr int kMostDirections = 8;

// A client in process has no limits of a server.
void limit_sizes(v1::SolveRequest* request) {
  fuzz::limit_budgets(request);
  if (request->has_scenarios()) {
    v1::Scenarios& s = *request->mutable_scenarios();
    s.set_max_sample_size(std::min<std::int64_t>(s.max_sample_size(), kMaxSampleSize));
    s.set_out_of_sample_scenarios(std::min<std::int64_t>(s.out_of_sample_scenarios(), kMaxSampleSize));
  }
  if (!request->has_sensitivity()) return;
  v1::SensitivityRequest& s = *request->mutable_sensitivity();
  if (s.directions().count() > kMostDirections) s.mutable_directions()->set_count(kMostDirections);
  if (s.losses().count() > kMostDirections) s.mutable_losses()->set_count(kMostDirections);
}

Bundle written_and_read(const Bundle& bundle) {
  std::string file;
  const auto written = write_bundle(bundle, [&file](std::string_view bytes) -> Expected<void> {
    file += bytes;
    return {};
  });
  FUZZ_EXPECT(written.has_value());
  auto read = read_bundle(file);
  if (!read) std::fprintf(stderr, "%s\n", read.error().message().c_str());
  FUZZ_EXPECT(read.has_value());
  return *std::move(read);
}

// The input's message of this type, or an empty one.
template <class Message>
Message message_of(const fuzz::Script& script) {
  for (const auto& any : script.details()) {
    if (Message message; any.Is<Message>() && any.UnpackTo(&message)) return message;
  }
  return {};
}

fuzz::Script make_bundle(fuzz::Draw& draw) {
  fuzz::Script script;
  script.add_details()->PackFrom(fuzz::make_any_solve(draw));
  if (draw.chance(50)) {
    v1::JobBundle facts;
    facts.set_version("0");
    v1::Trace& trace = *facts.mutable_job()->mutable_trace();
    trace.set_stride(draw.between(0, 3));
    for (int k = draw.between(0, 4); k > 0; --k) trace.add_rows()->set_iteration(k);
    script.add_details()->PackFrom(facts);
  }
  if (draw.chance(30)) {
    v1::SolveResponse response;
    response.mutable_solution()->set_status(v1::STATUS_SOLVED);
    for (int k = draw.between(0, 4); k > 0; --k) response.mutable_solution()->add_z(draw.hostile());
    script.add_details()->PackFrom(response);
  }
  return script;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                               unsigned seed) {
  return fuzz::mutate_bytes<fuzz::Script>(data, size, most, seed, make_bundle);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::judged(data, size, [&] {
    static const google::protobuf::LogSilencer silence;
    static const fuzz::SmallParts parts;
    static const Client client = Client::in_process();
    fuzz::Script script;
    if (!script.ParseFromArray(data, static_cast<int>(size))) return;
    auto request = std::make_shared<v1::SolveRequest>(message_of<v1::SolveRequest>(script));
    if (request->ByteSizeLong() == 0) return;  // no bundle holds one
    limit_sizes(request.get());
    request->clear_request_id();
    request->clear_priority();
    const auto options = options_of(request->options());
    if (!options) return fuzz::expect_sound(options.error());
    const auto done = fuzz::solve(parts.all, server::JobKind::solve, request);

    Bundle bundle{message_of<v1::JobBundle>(script), request->SerializeAsString(), {}};
    auto answer = message_of<v1::SolveResponse>(script);
    if (done) *answer.mutable_solution() = done->answer;
    bundle.answer = answer.SerializeAsString();
    bundle.facts.set_request_bytes(static_cast<std::int64_t>(bundle.request.size()));
    bundle.facts.set_answer_bytes(static_cast<std::int64_t>(bundle.answer.size()));
    const Bundle read = written_and_read(bundle);
    v1::SolveRequest again;
    FUZZ_EXPECT(again.ParseFromString(read.request));
    const auto solved = cli::solve_request(client, again, *options, {});
    if (!solved) {
      FUZZ_EXPECT(!done);
      return fuzz::expect_sound(solved.error());
    }
    std::vector<v1::Progress> rows(solved->rows.size());
    for (std::size_t k = 0; k < rows.size(); ++k) to_message(solved->rows[k], &rows[k]);
    for (const auto& one : cli::differences(read.facts.job().trace(), true, rows))
      FUZZ_EXPECT(!one.field.empty());
    const auto differences = cli::differences(answer.solution(), solved->solution);
    if (!done) return;
    if (!differences.empty())
      std::fprintf(stderr, "%s was %s, is %s\n", differences[0].field.c_str(), differences[0].before.c_str(),
                   differences[0].now.c_str());
    FUZZ_JUDGE(differences.empty());
    fuzz::judge_request(again, *options, solved->solution);
  });
}
