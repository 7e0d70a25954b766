// Who a client says it is, and what it refuses to start with.
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <map>
#include <thread>

#include "marble/client.h"
#include "marble/v1/service.grpc.pb.h"
#include "support/child_process.h"
#include "support/loopback.h"

namespace marble::testing {
namespace {

/// Answers GetInfo, and remembers what came with it.
class Listener final : public v1::Server::Service {
 public:
  Listener() {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  [[nodiscard]] std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  [[nodiscard]] std::string heard(const std::string& key) const {
    const auto found = metadata_.find(key);
    return found == metadata_.end() ? "" : found->second;
  }

 private:
  grpc::Status GetInfo(grpc::ServerContext* context, const v1::GetInfoRequest*,
                       v1::GetInfoResponse* response) override {
    for (const auto& [key, value] : context->client_metadata())
      metadata_[{key.data(), key.size()}] = {value.data(), value.size()};
    response->set_client("robot 7");
    response->add_roles("solve");
    response->mutable_limits()->mutable_quota()->set_sessions(3);
    return grpc::Status::OK;
  }

  std::map<std::string, std::string> metadata_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

TEST(Connect, TokenAndNameAreSentWithACall) {
  const Listener listener;
  const auto client = Client::connect(listener.address(), {.token = "s3cret", .name = "arm of robot 7"});
  ASSERT_TRUE(client.has_value());
  const auto info = client->info();
  ASSERT_TRUE(info.has_value()) << info.error().message();
  EXPECT_EQ(listener.heard("authorization"), "Bearer s3cret");
  EXPECT_EQ(listener.heard("marble-client"), "arm of robot 7");
  EXPECT_EQ(info->client, "robot 7");
  EXPECT_EQ(info->roles, std::vector<std::string>{"solve"});
  EXPECT_EQ(info->quota->sessions, 3);
}

TEST(Connect, NothingIsSentUnasked) {
  const Listener listener;
  ASSERT_TRUE(Client::connect(listener.address(), ConnectOptions{})->info().has_value());
  EXPECT_EQ(listener.heard("authorization"), "");
  EXPECT_EQ(listener.heard("marble-client"), "");
}

TEST(Connect, TheEnvironmentHasTheDefaults) {
  setenv("MARBLE_TOKEN", "from outside", 1);
  setenv("MARBLE_TLS_CA", "ca.pem", 1);
  const ConnectOptions options = ConnectOptions::from_environment();
  unsetenv("MARBLE_TOKEN");
  unsetenv("MARBLE_TLS_CA");
  EXPECT_EQ(options.token, "from outside");
  EXPECT_EQ(options.tls_ca, "ca.pem");
  EXPECT_EQ(options.tls_key, "");
}

TEST(Connect, ABadOptionIsAnErrorThatNamesIt) {
  const TemporaryDirectory directory;
  const std::string text = directory.file("text");
  std::ofstream(text) << "no certificate\n";
  const std::string pem = directory.file("pem");
  std::ofstream(pem) << "-----BEGIN CERTIFICATE-----\n";
  const std::pair<const char*, ConnectOptions> cases[] = {
      {"tls_ca", {.tls_ca = directory.file("missing")}},
      {"tls_ca", {.tls_ca = directory.file(".")}},
      {"tls_ca", {.tls_ca = text}},
      {"tls_certificate", {.tls_certificate = text, .tls_key = pem}},
      {"tls_key", {.tls_certificate = pem, .tls_key = directory.file("missing")}},
      {"tls_key", {.tls_certificate = pem}},
      {"tls_certificate", {.tls_key = pem}},
      {"token", {.token = "two words"}},
      {"token", {.token = "line\n"}},
      {"name", {.name = std::string(65, 'x')}},
      {"name", {.name = "\xc3\xa4"}},
      {"keepalive.silence", {.keepalive = {.silence = std::chrono::milliseconds(499)}}},
      {"keepalive.silence", {.keepalive = {.silence = std::chrono::hours(25)}}},
      {"keepalive.answer", {.keepalive = {.answer = std::chrono::seconds(0)}}},
      {"keepalive.answer", {.keepalive = {.answer = std::chrono::duration<double>(NAN)}}},
  };
  for (const auto& [field, options] : cases) {
    const auto client = Client::connect("127.0.0.1:1", options);
    ASSERT_FALSE(client.has_value()) << field;
    EXPECT_EQ(client.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(client.error().field, field) << client.error().message();
  }
  EXPECT_TRUE(Client::connect("127.0.0.1:1", {.tls = true, .token = "t", .name = "n"}).has_value());
}

TEST(Connect, AServerWithoutTlsIsUnavailableToAClientThatWantsIt) {
  const Listener listener;
  const auto info = Client::connect(listener.address(), {.tls = true})->info();
  ASSERT_FALSE(info.has_value());
  EXPECT_EQ(info.error().code, ErrorCode::unavailable);
  EXPECT_NE(info.error().message().find("does the server speak without TLS?"), std::string::npos)
      << info.error().message();
}

// As a server with TLS does with a client that begins without.
TEST(Connect, WhoIsShutOutIsAskedForTls) {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int port = listen_on(listener, loopback());
  std::thread shuts([&] {
    for (int one; (one = ::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC)) >= 0;) ::close(one);
  });
  const auto info = Client::connect("127.0.0.1:" + std::to_string(port))->info();
  ::shutdown(listener, SHUT_RDWR);
  shuts.join();
  ::close(listener);
  ASSERT_FALSE(info.has_value());
  EXPECT_EQ(info.error().code, ErrorCode::unavailable);
  EXPECT_NE(info.error().message().find("does the server want TLS"), std::string::npos)
      << info.error().message();
}

TEST(Connect, WhereNobodyListensTlsIsNoReason) {
  const auto info = Client::connect("127.0.0.1:1")->info();
  ASSERT_FALSE(info.has_value());
  EXPECT_EQ(info.error().message().find("TLS"), std::string::npos) << info.error().message();
}

}  // namespace
}  // namespace marble::testing
