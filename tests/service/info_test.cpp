// GetInfo, health and reflection: what the server reports about itself.
#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <map>

#include "marble/options.h"
#include "service_test.h"

namespace marble::testing {
namespace {

class Info : public ServiceTest {
 protected:
  v1::GetInfoResponse info() {
    const auto stub = v1::Server::NewStub(channel());
    grpc::ClientContext context;
    v1::GetInfoResponse response;
    EXPECT_TRUE(stub->GetInfo(&context, {}, &response).ok());
    return response;
  }
  // What reflection reports of the file that has a symbol.
  RawAnswer file_of(const std::string& symbol) {
    const std::string asked = std::string("\x22") + static_cast<char>(symbol.size()) + symbol;
    return raw_call(channel(), "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", asked);
  }
};

TEST_F(Info, ReportsEveryLimitInForce) {
  // Each of the message's limits is set to a number of its own.
  const auto* descriptor = v1::Limits::descriptor();
  const auto value = [](const google::protobuf::FieldDescriptor& field) {
    using Type = google::protobuf::FieldDescriptor;
    return (field.cpp_type() == Type::CPPTYPE_INT64 ? 2'000'000 : 100) + field.number();
  };
  std::vector<std::string> arguments{"--workers", "3"};
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const auto* field = descriptor->field(i);
    if (field->name() == "quota") continue;
    std::string flag = "--" + field->name();
    std::replace(flag.begin(), flag.end(), '_', '-');
    arguments.insert(arguments.end(), {flag, std::to_string(value(*field))});
  }
  start(arguments);
  const v1::GetInfoResponse response = info();
  EXPECT_FALSE(response.version().empty());
  EXPECT_EQ(response.workers(), 3);
  EXPECT_GE(response.uptime_s(), 0.0);
  const v1::Limits& limits = response.limits();
  const auto* reflection = limits.GetReflection();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const auto* field = descriptor->field(i);
    using Type = google::protobuf::FieldDescriptor;
    switch (field->cpp_type()) {
      case Type::CPPTYPE_INT32:
        EXPECT_EQ(reflection->GetInt32(limits, field), value(*field)) << field->name();
        break;
      case Type::CPPTYPE_INT64:
        EXPECT_EQ(reflection->GetInt64(limits, field), value(*field)) << field->name();
        break;
      case Type::CPPTYPE_DOUBLE:
        EXPECT_EQ(reflection->GetDouble(limits, field), value(*field)) << field->name();
        break;
      default:
        EXPECT_EQ(field->name(), "quota");
    }
  }
}

TEST_F(Info, ReportsTheCallersQuota) {
  start({"--client-running", "1", "--client-bytes", "21", "--client-priority", "batch", "--workers", "2",
         "--queue-jobs", "23", "--sessions", "11", "--client-sessions", "99"});
  const v1::Quota quota = info().limits().quota();
  EXPECT_EQ(quota.running(), 1);
  EXPECT_EQ(quota.queued(), 5) << "a quarter of the queue's where the client has none";
  EXPECT_EQ(quota.sessions(), 11) << "the server's, which is less than the client's";
  EXPECT_EQ(quota.watchers(), 64);
  EXPECT_EQ(quota.bytes(), 21);
  EXPECT_EQ(quota.priority(), v1::PRIORITY_BATCH);
}

TEST_F(Info, ReportsTheServersOwnDefaultsOfOptions) {
  TemporaryDirectory directory;
  std::ofstream(directory.file("config.toml")) << "[solver]\nmax_iterations = 7\npath = \"paper\"\n";
  start({"--config", directory.file("config.toml")});
  const v1::GetInfoResponse response = info();
  std::map<std::string, double> defaults;
  for (const v1::OptionSchema& option : response.options()) defaults[option.name()] = option.default_value();
  EXPECT_EQ(defaults.at("max_iterations"), 7.0);
  EXPECT_EQ(defaults.at("path"), 1.0) << "the second choice";
}

TEST_F(Info, ReportsEveryOptionOfTheTable) {
  start();
  const v1::GetInfoResponse response = info();
  ASSERT_EQ(response.options_size(), static_cast<int>(option_table().size()));
  for (int i = 0; i < response.options_size(); ++i) {
    const OptionInfo& option = option_table()[static_cast<std::size_t>(i)];
    EXPECT_EQ(response.options(i).name(), option.name);
    EXPECT_EQ(response.options(i).default_value(), option.default_value);
    EXPECT_EQ(response.options(i).choices_size(), static_cast<int>(option.choices.size()));
  }
}

TEST_F(Info, CountersAddUp) {
  start({"--workers", "1", "--queue-jobs", "1"});
  v1::SolveResponse response;
  EXPECT_TRUE(solve(example_request(), &response).ok());
  EXPECT_TRUE(solve(long_request(2), &response).ok());
  EXPECT_FALSE(solve(v1::SolveRequest(), &response).ok());
  {
    Stream running(solver(), long_request());
    ASSERT_TRUE(running.read_until(Event::kStarted));
    Stream waiting(solver(), long_request());
    ASSERT_TRUE(waiting.read_until(Event::kAccepted));
    EXPECT_FALSE(solve(example_request(), &response).ok());
    const v1::Counters now = counters();
    EXPECT_EQ(now.running(), 1);
    EXPECT_EQ(now.queued(), 1);
    EXPECT_EQ(now.accepted_total(), 4);
  }
  ASSERT_TRUE(eventually_idle());
  const v1::Counters now = counters();
  EXPECT_EQ(now.accepted_total(), 4);
  EXPECT_EQ(now.answered_total(), 2);
  EXPECT_EQ(now.solved_total(), 1);
  EXPECT_EQ(now.cancelled_total(), 2);
  EXPECT_EQ(now.refused_total(), 2);
}

TEST_F(Info, HealthSaysServing) {
  start();
  EXPECT_EQ(health(), "SERVING");
  for (const std::string service : {"marble.v1.Solver", "marble.v1.Server"}) {
    const std::string request = std::string("\x0a") + static_cast<char>(service.size()) + service;
    const RawAnswer answer = raw_call(channel(), "/grpc.health.v1.Health/Check", request);
    EXPECT_TRUE(answer.status.ok()) << answer.status.error_message();
    EXPECT_EQ(answer.bytes, "\x08\x01") << service;
  }
}

TEST_F(Info, ReflectionListsTheServices) {
  start();
  const std::string list_services = "\x3a\x01*";
  const RawAnswer answer =
      raw_call(channel(), "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", list_services);
  ASSERT_TRUE(answer.status.ok()) << answer.status.error_message();
  for (const char* service : {"marble.v1.Solver", "marble.v1.Server", "grpc.health.v1.Health"}) {
    EXPECT_NE(answer.bytes.find(service), std::string::npos) << service;
  }
}

TEST_F(Info, ReflectionKnowsTheDetailsOfErrors) {
  start();
  const RawAnswer answer = file_of("google.rpc.BadRequest");
  ASSERT_TRUE(answer.status.ok());
  EXPECT_NE(answer.bytes.find("field_violations"), std::string::npos);
}

TEST_F(Info, ReflectionDescribesHealth) {
  start();
  const RawAnswer answer = file_of("grpc.health.v1.Health");
  ASSERT_TRUE(answer.status.ok());
  EXPECT_NE(answer.bytes.find("HealthCheckRequest"), std::string::npos);
}

}  // namespace
}  // namespace marble::testing
