// Requests of the service Jobs, one after the other: submitted jobs are worked off by a real worker and their
// answers judged; what is then asked of them can be sent, and a bundle holds the request that it is of.
#include <google/protobuf/stubs/logging.h>

#include <map>
#include <optional>

#include "base/wire.h"
#include "expect.h"
#include "marble/convert.h"
#include "requests/findings.h"
#include "requests/judge.h"
#include "requests/make.h"
#include "requests/mutate.h"
#include "requests/submitted.h"
#include "requests/work.h"
#include "service/job_bundle.h"
#include "service/job_feed.h"
#include "service/job_requests.h"
#include "store/submissions.h"

using namespace marble;

namespace {

template <class Message>
void expect_same_again(const Message& message) {
  Message again;
  FUZZ_EXPECT(again.ParseFromString(message.SerializeAsString()));
  FUZZ_EXPECT(again.SerializeAsString() == message.SerializeAsString());
}

class Jobs {
 public:
  explicit Jobs(const server::ServiceParts& parts) : parts_(parts) {}
  ~Jobs() {
    for (const auto& [id, request] : asked_) (void)parts_.submissions->remove(caller_.identity, id);
  }

  void submit(v1::SolveRequest message) {
    fuzz::limit_budgets(&message);
    v1::SubmitResponse response;
    const auto request = std::make_shared<v1::SolveRequest>(message);
    const auto taken = parts_.submissions->submit(caller_, request, &response);
    if (!taken) return fuzz::expect_sound(taken.error());
    expect_same_again(response);
    FUZZ_EXPECT(!response.job_id().empty());
    if (!asked_.emplace(response.job_id(), message).second) return;  // the same again, by its request_id
    ids_.push_back(response.job_id());
    const auto result = fuzz::wait_for_answer(parts_, response.job_id());
    FUZZ_EXPECT(result != nullptr);
    if (!result->answer) return fuzz::expect_sound(result->answer.error());
    grpc::ByteBuffer bytes(*result->answer);
    v1::SolveResponse answer;
    FUZZ_EXPECT(server::parse(&bytes, &answer, 100000).has_value());
    FUZZ_EXPECT(answer.job_id() == response.job_id());
    const auto options = options_of(message.options());
    FUZZ_EXPECT(options.has_value());
    fuzz::judge_request(message, *options, answer.solution());
  }

  void ask(const v1::ListJobsRequest& request) {
    v1::ListJobsRequest named = request;
    named.set_before_job_id(id_of(request.before_job_id()));
    v1::ListJobsResponse response;
    expect_response(server::list_jobs(parts_.board, caller_.identity, named, &response), response);
  }
  void ask(const v1::GetJobRequest& request) {
    v1::GetJobResponse response;
    expect_response(server::get_job(parts_.board, caller_.identity, id_of(request.job_id()), &response),
                    response);
  }
  void ask(const v1::JobResultRequest& request) {
    const std::string id = id_of(request.job_id());
    FUZZ_EXPECT((parts_.results.get(id) != nullptr) == (asked_.count(id) > 0));
  }
  void ask(const v1::CancelJobRequest& request) {
    v1::CancelJobResponse response;
    expect_response(parts_.submissions->cancel(caller_.identity, id_of(request.job_id()), &response),
                    response);
  }
  void ask(const v1::DeleteJobRequest& request) {
    const std::string id = id_of(request.job_id());
    const auto removed = parts_.submissions->remove(caller_.identity, id);
    FUZZ_EXPECT(removed.has_value() == (asked_.erase(id) > 0));
    if (!removed) fuzz::expect_sound(removed.error());
  }
  void ask(const v1::WatchJobsRequest& request) {
    v1::WatchJobsRequest named = request;
    named.set_job_id(id_of(request.job_id()));
    const auto feed = server::JobFeed::open(parts_.board, parts_.feeds, caller_.identity, {}, named);
    if (!feed) return fuzz::expect_sound(feed.error());
    v1::WatchJobsResponse response;
    for (int times = 0; times < 3 && (*feed)->next(&response); ++times) expect_same_again(response);
  }
  void ask(const v1::JobBundleRequest& request) {
    const std::string id = id_of(request.job_id());
    server::gather_bundle(parts_, caller_.identity, id, [&](const Expected<server::GatheredBundle>& bundle) {
      if (!bundle) return fuzz::expect_sound(bundle.error());
      std::string file;
      const auto written = write_bundle(**bundle, [&file](std::string_view bytes) -> Expected<void> {
        file += bytes;
        return {};
      });
      FUZZ_EXPECT(written.has_value());
      const auto read = read_bundle(file);
      FUZZ_EXPECT(read.has_value());
      v1::SolveRequest own = asked_.at(id);
      own.clear_request_id();
      FUZZ_EXPECT(read->request == own.SerializeAsString());
      FUZZ_EXPECT(read->answer == (*bundle)->answer);
      replay(*read);
    });
  }

 private:
  // As the job said itself, solved again from its bundle: the same bits.
  void replay(const Bundle& bundle) {
    const auto request = std::make_shared<v1::SolveRequest>();
    FUZZ_EXPECT(request->ParseFromString(bundle.request));
    const auto again = fuzz::solve(parts_, server::JobKind::solve, request);
    v1::SolveResponse before;
    FUZZ_EXPECT(before.ParseFromString(bundle.answer));
    FUZZ_EXPECT(again.has_value() == before.has_solution());
    if (!again) return;
    FUZZ_EXPECT(again->answer.status() == before.solution().status());
    v1::Solution z, now;
    z.mutable_z()->CopyFrom(before.solution().z());
    now.mutable_z()->CopyFrom(again->answer.z());
    FUZZ_EXPECT(z.SerializeAsString() == now.SerializeAsString());
  }

  // Of the n-th that was submitted here, where there is one.
  [[nodiscard]] std::string id_of(const std::string& text) const {
    if (text.size() != 1 || text[0] < '0') return text;
    const auto number = static_cast<std::size_t>(text[0] - '0');
    return number < ids_.size() ? ids_[number] : text;
  }

  template <class Result, class Response>
  void expect_response(const Result& result, const Response& response) {
    if (!result) return fuzz::expect_sound(result.error());
    expect_same_again(response);
  }

  const server::ServiceParts& parts_;
  const server::Caller caller_ = fuzz::any_caller();
  std::vector<std::string> ids_;
  std::map<std::string, v1::SolveRequest> asked_;
};

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                               unsigned seed) {
  return fuzz::mutate_bytes<fuzz::Script>(data, size, most, seed, fuzz::make_jobs);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::judged(data, size, [&] {
    static const google::protobuf::LogSilencer silence;
    static const fuzz::SmallParts parts(1 << 20, 1 << 20);
    fuzz::Script script;
    if (!script.ParseFromArray(data, static_cast<int>(size))) return;
    Jobs jobs(parts.all);
    for (int k = 0; k < std::min(script.details_size(), 12); ++k) {
      const auto ask = [&]<class Message>(Message message) {
        if (script.details(k).Is<Message>() && script.details(k).UnpackTo(&message)) jobs.ask(message);
      };
      v1::SolveRequest request;
      if (script.details(k).Is<v1::SolveRequest>() && script.details(k).UnpackTo(&request))
        jobs.submit(std::move(request));
      ask(v1::ListJobsRequest());
      ask(v1::GetJobRequest());
      ask(v1::JobResultRequest());
      ask(v1::CancelJobRequest());
      ask(v1::DeleteJobRequest());
      ask(v1::WatchJobsRequest());
      ask(v1::JobBundleRequest());
    }
  });
}
