// What tests of the HTTP port share: a client, JSON, and event streams that are read as they come.
#pragma once

#include <httplib.h>

#include <atomic>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "secure_service_test.h"
#include "support/loopback.h"

namespace marble::testing {

using Json = nlohmann::json;

inline httplib::Headers bearer_header(const std::string& token) {
  return {{"Authorization", "Bearer " + token}};
}

/// One event stream, read by a thread of its own until it ends or the reader does.
class EventReader {
 public:
  struct Event {
    std::string name;
    Json data;
  };

  EventReader(const std::string& server, const std::string& path, const httplib::Headers& headers = {}) {
    thread_ = std::thread([this, server, path, headers] {
      httplib::Client client(server);
      client.set_read_timeout(60);
      const auto result = client.Get(
          path, headers,
          [this](const httplib::Response& response) {
            status_ = response.status;
            return true;
          },
          [this](const char* bytes, std::size_t size) {
            return take({bytes, size});
          });
      ended_ = true;
    });
  }
  ~EventReader() {
    stopping_ = true;
    thread_.join();
  }
  EventReader(const EventReader&) = delete;
  EventReader& operator=(const EventReader&) = delete;

  [[nodiscard]] std::vector<Event> events(const std::string& name) const {
    const std::lock_guard lock(mutex_);
    std::vector<Event> result;
    for (const Event& event : events_) {
      if (event.name == name) result.push_back(event);
    }
    return result;
  }
  [[nodiscard]] bool eventually_has(const std::string& name) const {
    return eventually([&] { return !events(name).empty(); });
  }
  /// 0 until the stream has begun.
  [[nodiscard]] int status() const { return status_; }
  [[nodiscard]] bool ended() const { return ended_; }

 private:
  bool take(const std::string& bytes) {
    const std::lock_guard lock(mutex_);
    rest_ += bytes;
    for (std::size_t end = rest_.find("\n\n"); end != std::string::npos; end = rest_.find("\n\n")) {
      const std::string block = rest_.substr(0, end);
      rest_.erase(0, end + 2);
      const std::size_t data = block.find("\ndata: ");
      if (block.rfind("event: ", 0) == 0 && data != std::string::npos)
        events_.push_back({block.substr(7, data - 7), Json::parse(block.substr(data + 7))});
    }
    return !stopping_;
  }

  mutable std::mutex mutex_;
  std::string rest_;
  std::vector<Event> events_;
  std::atomic<int> status_ = 0;
  std::atomic<bool> ended_ = false, stopping_ = false;
  std::thread thread_;
};

class HttpServiceTest : public SecureServiceTest {
 protected:
  void start(std::vector<std::string> flags = {}) {
    flags.insert(flags.end(), {"--http", "127.0.0.1:0"});
    ServiceTest::start(flags);
  }
  [[nodiscard]] httplib::Client client() { return httplib::Client(server().http()); }
  [[nodiscard]] httplib::Result get(const std::string& path, const httplib::Headers& headers = {}) {
    return client().Get(path, headers);
  }
  [[nodiscard]] httplib::Result cancel(const std::string& id, httplib::Headers headers = {}) {
    headers.emplace("Marble-Request", "1");
    return client().Post("/api/jobs/" + id + "/cancel", headers, "", "application/json");
  }
  /// POST of this text as JSON to /api/jobs.
  [[nodiscard]] httplib::Result post(const std::string& text, const httplib::Headers& headers = {}) {
    return client().Post("/api/jobs", headers, text, "application/json");
  }
  /// The id of the job that this becomes.
  [[nodiscard]] std::string posted(const Json& request, const httplib::Headers& headers = {}) {
    const auto answer = post(request.dump(), headers);
    EXPECT_EQ(answer->status, 202) << answer->body;
    return answer->status == 202 ? Json::parse(answer->body).at("job_id").get<std::string>() : "";
  }
  [[nodiscard]] static Json error_of(const httplib::Result& result) {
    return Json::parse(result->body).at("error");
  }
  [[nodiscard]] std::string submit(const v1::SolveRequest& request, const Metadata& metadata = {}) {
    grpc::ClientContext context;
    for (const auto& [key, value] : metadata) context.AddMetadata(key, value);
    v1::SubmitResponse response;
    const grpc::Status status = v1::Jobs::NewStub(channel())->Submit(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.job_id();
  }
  [[nodiscard]] v1::GetJobResponse job(const std::string& id) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_job_id(id);
    v1::GetJobResponse response;
    EXPECT_TRUE(v1::Jobs::NewStub(channel())->Get(&context, request, &response).ok());
    return response;
  }
  [[nodiscard]] bool eventually_finished(const std::string& id) {
    return eventually([&] { return job(id).job().state() == v1::JOB_STATE_FINISHED; });
  }
};

}  // namespace marble::testing
