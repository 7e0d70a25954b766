// A request as bytes, through admission and the work itself, whatever it asks for: an error that names its
// field, or an answer that a judge of its own takes. Built once a kind of request: FUZZ_MAKE makes what a run
// begins with; without it the bytes are libFuzzer's own, so that the parser sees malformed messages too.
#include <google/protobuf/stubs/logging.h>

#include <cstdint>

#include "base/wire.h"
#include "requests/findings.h"
#include "requests/judge.h"
#include "requests/make.h"
#include "requests/mutate.h"
#include "requests/work.h"

using namespace marble;

#ifdef FUZZ_MAKE
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                               unsigned seed) {
  return fuzz::mutate_bytes<v1::SolveRequest>(data, size, most, seed, fuzz::FUZZ_MAKE);
}
#endif

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::judged(data, size, [&] {
    static const google::protobuf::LogSilencer silence;
    static const fuzz::SmallParts parts;
    const grpc::Slice slice(data, size);
    const grpc::ByteBuffer bytes(&slice, 1);
    const auto request = std::make_shared<v1::SolveRequest>();
    if (const auto parsed = server::parse(&bytes, request.get()); !parsed) {
      fuzz::expect_sound(parsed.error());
      return;
    }
    fuzz::limit_budgets(request.get());
    // Elements of a batch and jobs that are submitted take the same path, under another kind.
    constexpr server::JobKind kKinds[] = {server::JobKind::solve, server::JobKind::batch,
                                          server::JobKind::submitted};
    const auto done = fuzz::solve(parts.all, kKinds[request->request_id().size() % 3], request);
    if (done) fuzz::judge_request(*request, done->job->record->options(), done->answer);
  });
}
