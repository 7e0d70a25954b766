#include "client.h"

#include <algorithm>
#include <chrono>
#include <thread>

#include "google/rpc/status.pb.h"
#include "judgement.h"
#include "service_test.h"

namespace marble::testing {

constexpr std::size_t kMostFaults = 50;  // more report nothing new

void Environment::next_generation() {
  const std::scoped_lock lock(mutex_);
  ++generation_;
  changed_.notify_all();
}

int Environment::wait_for_server() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return generation_ % 2 == 0; });
  return generation_;
}

bool Environment::go_on() {
  std::unique_lock lock(mutex_);
  if (resting_) {
    ++at_rest_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !resting_; });
    --at_rest_;
  }
  return !stopped_;
}

void Environment::rest() {
  std::unique_lock lock(mutex_);
  resting_ = true;
  changed_.wait(lock, [this] { return at_rest_ == clients_; });
}

void Environment::resume() {
  const std::scoped_lock lock(mutex_);
  resting_ = false;
  changed_.notify_all();
}

void Environment::stop() { stopped_ = true; }

void Environment::fault(const std::string& text) {
  const std::scoped_lock lock(mutex_);
  if (faults_.size() < kMostFaults) faults_.push_back(text);
}

std::vector<std::string> Environment::faults() const {
  const std::scoped_lock lock(mutex_);
  return faults_;
}

namespace {

constexpr std::chrono::seconds kHang{100};  // within the test's own limit, and beyond any call's work
constexpr int kLongestWait = 50;            // ms, of what a server asks a refused client to wait

const char* name_of(grpc::StatusCode code) {
  switch (code) {
    case grpc::StatusCode::OK:
      return "OK";
    case grpc::StatusCode::CANCELLED:
      return "CANCELLED";
    case grpc::StatusCode::INVALID_ARGUMENT:
      return "INVALID_ARGUMENT";
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return "DEADLINE_EXCEEDED";
    case grpc::StatusCode::NOT_FOUND:
      return "NOT_FOUND";
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
      return "RESOURCE_EXHAUSTED";
    case grpc::StatusCode::FAILED_PRECONDITION:
      return "FAILED_PRECONDITION";
    case grpc::StatusCode::ABORTED:
      return "ABORTED";
    case grpc::StatusCode::UNAVAILABLE:
      return "UNAVAILABLE";
    default:
      return "another code";
  }
}

}  // namespace

void Client::run() {
  while (environment_.go_on()) {
    if (disturbed()) connect_again();
    count("episodes");
    episode();
  }
  channel_ = nullptr;
}

void Client::connect_again() {
  const int generation = environment_.wait_for_server();
  channel_ = connect(environment_.address());
  const bool there = channel_->WaitForConnected(std::chrono::system_clock::now() + kHang);
  generation_ = generation;
  if (!there && !disturbed()) fault("cannot connect");
  solver_ = v1::Solver::NewStub(channel_);
  jobs_ = v1::Jobs::NewStub(channel_);
  connected(channel_);
}

void Client::connected(const std::shared_ptr<grpc::Channel>& /*channel*/) {}

std::unique_ptr<grpc::ClientContext> Client::new_context() {
  auto context = std::make_unique<grpc::ClientContext>();
  context->set_deadline(std::chrono::system_clock::now() + kHang);
  return context;
}

bool Client::ended(const grpc::Status& status, const std::string& what, std::initializer_list<Code> allowed) {
  const Code code = status.error_code();
  count(name_of(code));
  if (code == Code::OK || std::find(allowed.begin(), allowed.end(), code) != allowed.end()) {
    if (code == Code::INVALID_ARGUMENT)
      expect(!bad_field(status).field().empty(), what + ": no field: " + status.error_message());
    return code == Code::OK;
  }
  // A server that has reported all its answers cuts off who does not read them.
  if (disturbed() && code == Code::UNAVAILABLE) return false;
  if (code == Code::RESOURCE_EXHAUSTED) {
    expect(retry_info(status).has_value(), what + ": no RetryInfo: " + status.error_message());
    dawdle(kLongestWait);
    return false;
  }
  fault(what + ": " + name_of(code) + " (" + std::to_string(code) + "): " + status.error_message());
  return false;
}

bool Client::ended(const google::rpc::Status& status, const std::string& what,
                   std::initializer_list<Code> allowed) {
  return ended(grpc::Status(static_cast<Code>(status.code()), status.message(), status.SerializeAsString()),
               what, allowed);
}

void Client::answered(const v1::Problem& problem, const v1::Solution& solution) {
  const Judgement judgement = judge(problem, solution);
  count(judgement.solved ? "solved" : "unsolved");
  if (!judgement.fault.empty()) fault(judgement.fault);
}

void Client::dawdle(int most_ms) { std::this_thread::sleep_for(std::chrono::milliseconds(pick(0, most_ms))); }

}  // namespace marble::testing
