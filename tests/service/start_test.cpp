#include <google/protobuf/descriptor.h>
#include <sched.h>

#include <algorithm>
#include <map>

#include "marble/options.h"
#include "secure_service_test.h"
#include "service_test.h"

namespace marble::testing {
namespace {

// Starting: addresses, settings, and refusals in words.
class Start : public ServiceTest {
 protected:
  /// Runs the server to its end; for what must not start. -1 if it did.
  int run(const std::vector<std::string>& flags, const std::vector<std::string>& environment = {}) {
    std::vector<std::string> arguments = {MARBLE_SERVER_BINARY};
    arguments.insert(arguments.end(), flags.begin(), flags.end());
    ChildProcess process(arguments, directory_.file("output"), environment);
    const bool ended = eventually([&] { return !process.running(); });
    output_ = process.output();
    return ended ? process.wait() : -1;
  }
  [[nodiscard]] bool said(const std::string& text) const { return output_.find(text) != std::string::npos; }

  TemporaryDirectory directory_;
  std::string output_;
};

TEST_F(Start, ThereIsAWorkerForEachCoreThatItMayUse) {
  cpu_set_t all, first;
  ASSERT_EQ(sched_getaffinity(0, sizeof all, &all), 0);
  CPU_ZERO(&first);
  for (int core = 0; CPU_COUNT(&first) == 0; ++core) {
    if (CPU_ISSET(core, &all)) CPU_SET(core, &first);
  }
  ASSERT_EQ(sched_setaffinity(0, sizeof first, &first), 0);
  start();
  sched_setaffinity(0, sizeof all, &all);
  EXPECT_TRUE(eventually([&] {
    return !server().log_lines({"listening", "workers=1"}).empty();
  })) << server().log();
}

TEST_F(Start, ASecondServerOnThePortFailsAndNamesIt) {
  start();
  EXPECT_EQ(run({"--listen", server().address()}), 1);
  EXPECT_TRUE(said(server().address())) << output_;
  EXPECT_TRUE(said("in use")) << output_;
  EXPECT_TRUE(lives());
}

TEST_F(Start, ASecondServerLeavesTheUnixSocketToTheFirst) {
  const std::string address = "unix:" + directory_.file("socket");
  start({"--listen", address});
  EXPECT_EQ(run({"--listen", address}), 1);
  EXPECT_TRUE(said("in use")) << output_;
  EXPECT_TRUE(lives());
}

TEST_F(Start, AUnixSocketLeftBehindIsTakenOver) {
  const std::string address = "unix:" + directory_.file("socket");
  start({"--listen", address});
  server().send(SIGKILL);
  EXPECT_EQ(server().wait(), -SIGKILL);
  start({"--listen", address});
  EXPECT_TRUE(lives());
}

TEST_F(Start, TheAddressThatFailedIsTheOneNamed) {
  start();
  EXPECT_EQ(run({"--listen", "127.0.0.1:0", "--listen", server().address()}), 1);
  EXPECT_TRUE(said(server().address())) << output_;
}

TEST_F(Start, ListensOnEveryAddressGiven) {
  start({"--listen", "127.0.0.1:0", "--listen", "unix:" + directory_.file("socket")});
  ASSERT_EQ(server().addresses().size(), 2U);
  for (const std::string& address : server().addresses()) {
    const auto stub = v1::Solver::NewStub(connect(address));
    grpc::ClientContext context;
    v1::SolveResponse response;
    EXPECT_TRUE(stub->Solve(&context, example_request(), &response).ok()) << address;
  }
}

TEST_F(Start, RefusesOtherAddressesWithoutInsecure) {
  for (const char* address : {"0.0.0.0:0", "[::]:0", "192.0.2.1:50051", "example.org:1",
                              "127.0.0.1.example.org:1", "dns:///0.0.0.0:0", "ipv4:0.0.0.0:0"}) {
    EXPECT_EQ(run({"--listen", address}), 2) << address;
    EXPECT_TRUE(said("--insecure")) << output_;
  }
}

TEST_F(Start, ListensAnywhereWhenReported) {
  start({"--listen", "0.0.0.0:0", "--insecure", "--allow-anonymous"});
  // A server that listens on 127.0.0.1 alone does not hear this one.
  const std::string port = server().address().substr(server().address().rfind(':') + 1);
  const auto channel = grpc::CreateChannel("127.0.0.2:" + port, grpc::InsecureChannelCredentials());
  EXPECT_TRUE(channel->WaitForConnected(std::chrono::system_clock::now() + std::chrono::seconds(60)));
}

TEST_F(Start, RefusesUnknownFlagsAndValuesOutOfRange) {
  EXPECT_EQ(run({"--no-such-flag"}), 2);
  EXPECT_EQ(run({"--workers", "-1"}), 2);
  EXPECT_EQ(run({"--workers", "many"}), 2);
  EXPECT_EQ(run({"--log-level", "shout"}), 2);
  EXPECT_EQ(run({"--drain-grace-s", "nan"}), 2);
}

TEST_F(Start, RefusesAnEnvironmentOutOfRange) {
  EXPECT_EQ(run({}, {"MARBLE_WORKERS=-1"}), 2);
  EXPECT_TRUE(said("MARBLE_WORKERS") || said("workers")) << output_;
}

TEST_F(Start, HelpAndVersionAreNoErrors) {
  EXPECT_EQ(run({"--help"}), 0);
  EXPECT_TRUE(said("--queue-jobs") && said("--drain-grace-s") && said("MARBLE_WORKERS")) << output_;
  EXPECT_EQ(run({"--version"}), 0);
  EXPECT_TRUE(said("marble-server ")) << output_;
}

// SIGHUP: what changes while the server runs, what does not, and what must not.
class Reload : public SecureServiceTest {
 protected:
  void reload() { server().send(SIGHUP); }
  /// How often the log says it, once it says it often enough.
  bool eventually_reloaded(std::size_t times) {
    return eventually([&] { return server().log_lines({" reloaded "}).size() >= times; });
  }
};

TEST_F(Reload, AddsAndRemovesTokens) {
  const Token first = new_token("first:solve"), second = new_token("second:observe");
  const std::string file = write("tokens", first.line);
  start({"--tokens", file});
  EXPECT_TRUE(ask(bearer(first.secret)).ok());
  EXPECT_FALSE(ask(bearer(second.secret)).ok());
  write("tokens", second.line);
  EXPECT_TRUE(ask(bearer(first.secret)).ok()) << "not before it is asked to";
  reload();
  ASSERT_TRUE(eventually_reloaded(1));
  EXPECT_FALSE(ask(bearer(first.secret)).ok());
  EXPECT_TRUE(ask(bearer(second.secret)).ok());
  EXPECT_EQ(server().log_lines({"reloaded", "tokens"}).size(), 1U) << server().log();
}

TEST_F(Reload, ChangesQuotas) {
  write("config.toml", "client_queued = 7\n");
  start({"--config", directory_.file("config.toml")});
  EXPECT_EQ(ask().info.limits().quota().queued(), 7);
  write("config.toml", "client_queued = 8\n[clients.planner]\nqueued = 9\n");
  reload();
  ASSERT_TRUE(eventually_reloaded(1));
  EXPECT_EQ(ask().info.limits().quota().queued(), 8);
  EXPECT_EQ(ask({{"marble-client", "planner"}}).info.limits().quota().queued(), 9);
  EXPECT_EQ(server().log_lines({"reloaded", "client_queued, clients.planner"}).size(), 1U) << server().log();
  write("config.toml", "");
  reload();
  ASSERT_TRUE(eventually_reloaded(2));
  EXPECT_EQ(ask({{"marble-client", "planner"}}).info.limits().quota().queued(), 256)
      << "a quarter of the queue's";
}

TEST_F(Reload, ChangesTheLogLevel) {
  write("config.toml", "log_level = \"error\"\n");
  start({"--config", directory_.file("config.toml")});
  EXPECT_TRUE(server().log_lines({"listening"}).empty());
  write("config.toml", "log_level = \"info\"\n");
  reload();
  EXPECT_TRUE(eventually_logged({"reloaded", "log_level"}));
}

TEST_F(Reload, WithoutAChangeSaysSo) {
  start();
  reload();
  EXPECT_TRUE(eventually_logged({"reloaded", "nothing"}));
  EXPECT_TRUE(lives());
}

TEST_F(Reload, WarnsOfWhatOnlyARestartChanges) {
  write("config.toml", "queue_jobs = 10\nclient_queued = 1\n");
  start({"--config", directory_.file("config.toml")});
  write("config.toml", "queue_jobs = 20\nclient_queued = 2\n[solver]\nmax_iterations = 5\n");
  reload();
  ASSERT_TRUE(eventually_reloaded(1));
  EXPECT_FALSE(server().log_lines({"needs_restart", "\"queue_jobs\"", "config.toml:1"}).empty())
      << server().log();
  EXPECT_FALSE(server().log_lines({"needs_restart", "\"solver.max_iterations\""}).empty()) << server().log();
  const v1::Limits limits = ask().info.limits();
  EXPECT_EQ(limits.queue_jobs(), 10);
  EXPECT_EQ(limits.quota().queued(), 2) << "what can change does";
}

TEST_F(Reload, AnInvalidFileChangesNothing) {
  const Token token = new_token("planner:solve");
  write("tokens", token.line);
  const std::string tokens = "tokens = \"" + directory_.file("tokens") + "\"\n";
  write("config.toml", tokens + "client_queued = 7\n");
  start({"--config", directory_.file("config.toml")});
  write("config.toml", tokens + "client_queued = 8\nworkerz = 1\n");
  reload();
  ASSERT_TRUE(eventually_logged({"reload_refused", "config.toml:3", "workerz"})) << server().log();
  EXPECT_EQ(ask(bearer(token.secret)).info.limits().quota().queued(), 7);
  write("tokens", "nonsense\n");
  write("config.toml", tokens + "client_queued = 8\n");
  reload();
  ASSERT_TRUE(eventually_logged({"reload_refused", "tokens:1"})) << server().log();
  EXPECT_EQ(ask(bearer(token.secret)).info.limits().quota().queued(), 7) << "nor does half of it";
}

// GetInfo, health and reflection: what the server reports about itself.
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
