// Jobs that outlive their calls, and those who watch everything.
#include <set>

#include "client.h"
#include "judgement.h"
#include "problems.h"

namespace marble::testing {
namespace {

class SubmitClient final : public Client {
 public:
  SubmitClient(Environment& environment, std::uint64_t seed) : Client(environment, "submitted jobs", seed) {}

 private:
  void episode() override {
    const v1::SolveRequest request = chance(0.3) ? long_request(pick(1, 80)) : small_problems()[3];
    v1::SubmitResponse submitted;
    const auto context = new_context();
    if (!ended(jobs().Submit(context.get(), request, &submitted), "submit")) return;
    const std::string& id = submitted.job_id();
    if (chance(0.4)) watch(id);
    const bool cancelled = chance(0.2);
    if (cancelled) cancel(id);
    if (chance(0.2)) come_back_early(id);
    if (chance(0.8)) {
      v1::JobResultRequest wanted;
      wanted.set_job_id(id);
      wanted.set_wait(true);
      v1::SolveResponse response;
      const auto waiting = new_context();
      const grpc::Status status = jobs().Result(waiting.get(), wanted, &response);
      // Answers are kept within bounds only.
      if (cancelled ? ended(status, "result of a cancelled job", {Code::CANCELLED, Code::NOT_FOUND})
                    : ended(status, "result", {Code::NOT_FOUND})) {
        expect(response.job_id() == id, "another job's answer");
        answered(request.problem(), response.solution());
      }
    }
    if (chance(0.5)) remove(id);
  }

  void watch(const std::string& id) {
    const auto context = new_context();
    v1::WatchJobsRequest request;
    request.set_job_id(id);
    const auto reader = jobs().Watch(context.get(), request);
    bool finished = false;
    for (v1::WatchJobsResponse response; reader->Read(&response);) {
      expect(!finished, "an event after the job has finished");
      for (const v1::JobEvent& event : response.events()) {
        expect(event.job().job_id() == id, "another job's event");
        finished = event.job().state() == v1::JOB_STATE_FINISHED;
      }
      if (chance(0.02)) context->TryCancel();
    }
    if (ended(reader->Finish(), "watch", {Code::CANCELLED, Code::NOT_FOUND}))
      expect(finished, "a watch that ended before its job");
  }

  void cancel(const std::string& id) {
    const auto context = new_context();
    v1::CancelJobRequest request;
    request.set_job_id(id);
    v1::CancelJobResponse response;
    ended(jobs().Cancel(context.get(), request, &response), "cancel", {Code::NOT_FOUND});
  }

  // Does not wait, or not long.
  void come_back_early(const std::string& id) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(pick(1, 20)));
    v1::JobResultRequest request;
    request.set_job_id(id);
    request.set_wait(chance(0.5));
    v1::SolveResponse response;
    ended(jobs().Result(&context, request, &response), "early result",
          {Code::FAILED_PRECONDITION, Code::DEADLINE_EXCEEDED, Code::NOT_FOUND, Code::CANCELLED});
  }

  void remove(const std::string& id) {
    const auto context = new_context();
    v1::DeleteJobRequest request;
    request.set_job_id(id);
    v1::DeleteJobResponse response;
    ended(jobs().Delete(context.get(), request, &response), "delete", {Code::NOT_FOUND});
  }
};

// Every job's events, at times slower than they come.
class WatchClient final : public Client {
 public:
  WatchClient(Environment& environment, std::uint64_t seed) : Client(environment, "watchers", seed) {}

 private:
  void episode() override {
    grpc::ClientContext context;  // with a deadline of its own: while all rest, there is nothing to report
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(pick(1, 3000)));
    v1::WatchJobsRequest request;
    if (chance(0.5)) request.set_progress_interval_s(0.1);
    const auto reader = jobs().Watch(&context, request);
    int left = pick(1, 60);
    const int slow_ms = chance(0.5) ? 0 : 100;
    for (v1::WatchJobsResponse response; reader->Read(&response);) {
      std::set<std::string> ids;
      for (const v1::JobEvent& event : response.events()) {
        count("events");
        expect(ids.insert(event.job().job_id()).second, "a job twice in one message");
        expect(event.job().state() != v1::JOB_STATE_UNSPECIFIED, "a job without a state");
      }
      if (--left == 0) context.TryCancel();
      if (slow_ms > 0) dawdle(slow_ms);
    }
    ended(reader->Finish(), "watch of all", {Code::CANCELLED, Code::DEADLINE_EXCEEDED});
  }
};

}  // namespace

std::unique_ptr<Client> make_submit_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<SubmitClient>(environment, seed);
}

std::unique_ptr<Client> make_watch_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<WatchClient>(environment, seed);
}

}  // namespace marble::testing
