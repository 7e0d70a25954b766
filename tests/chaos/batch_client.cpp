// Many problems on one stream: every tag has one outcome.
#include <map>
#include <thread>

#include "clients.h"
#include "google/rpc/status.pb.h"
#include "judgement.h"

namespace marble::testing {
namespace {

class BatchClient final : public Client {
 public:
  BatchClient(Environment& environment, std::uint64_t seed) : Client(environment, "batches", seed) {}

 private:
  void episode() override {
    const bool given_up = chance(0.3);
    const int size = pick(1, 120);
    std::vector<int> kinds;  // of each tag: which of the small problems, or -1 for a malformed one
    for (int tag = 0; tag < size; ++tag)
      kinds.push_back(chance(0.05) ? -1 : pick(0, static_cast<int>(small_problems().size()) - 1));
    const auto context = new_context();
    const auto stream = solver().SolveBatch(context.get());
    std::thread writer([&] {
      for (int tag = 0; tag < size; ++tag) {
        v1::SolveBatchRequest request;
        request.set_tag(tag);
        const int kind = kinds[static_cast<std::size_t>(tag)];
        if (kind >= 0) *request.mutable_solve() = small_problems()[static_cast<std::size_t>(kind)];
        if (!stream->Write(request)) break;
      }
      stream->WritesDone();
    });
    std::map<std::int64_t, int> outcomes;
    int until_given_up = given_up ? pick(0, size) : -1;
    if (until_given_up == 0) context->TryCancel();
    for (v1::SolveBatchResponse response; stream->Read(&response);) {
      ++outcomes[response.tag()];
      if (response.tag() < 0 || response.tag() >= size) {
        fault("a tag nobody sent");
      } else {
        take(response, kinds[static_cast<std::size_t>(response.tag())]);
      }
      if (--until_given_up == 0) context->TryCancel();
    }
    writer.join();
    const grpc::Status status = stream->Finish();
    const bool ok = given_up ? ended(status, "batch given up", {Code::CANCELLED}) : ended(status, "batch");
    for (const auto& [tag, times] : outcomes) expect(times == 1, "a tag was answered twice");
    if (ok) expect(outcomes.size() == static_cast<std::size_t>(size), "tags without an outcome");
  }

  void take(const v1::SolveBatchResponse& response, int kind) {
    if (kind < 0) {
      expect(response.has_error(), "a malformed problem was solved");
      ended(response.error(), "malformed item", {Code::INVALID_ARGUMENT});
    } else if (response.has_result()) {
      answered(small_problems()[static_cast<std::size_t>(kind)].problem(), response.result().solution());
    } else {
      ended(response.error(), "item");
    }
  }
};

}  // namespace

std::unique_ptr<Client> make_batch_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<BatchClient>(environment, seed);
}

}  // namespace marble::testing
