// What tests of TLS, tokens and reloads share.
#pragma once

#include "service_test.h"
#include "test_authority.h"

namespace marble::testing {

class SecureServiceTest : public ServiceTest {
 protected:
  struct Answer {
    grpc::Status status;
    v1::GetInfoResponse info;
    [[nodiscard]] bool ok() const { return status.ok(); }
    [[nodiscard]] std::vector<std::string> roles() const {
      return {info.roles().begin(), info.roles().end()};
    }
  };
  using Metadata = std::vector<std::pair<std::string, std::string>>;

  /// GetInfo over a connection of its own.
  [[nodiscard]] Answer ask(const std::shared_ptr<grpc::ChannelCredentials>& credentials,
                           const Metadata& metadata = {}, const std::string& address = "") {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    const auto stub = v1::Server::NewStub(
        grpc::CreateCustomChannel(address.empty() ? server().address() : address, credentials, arguments));
    grpc::ClientContext context;
    for (const auto& [key, value] : metadata) context.AddMetadata(key, value);
    Answer answer;
    answer.status = stub->GetInfo(&context, {}, &answer.info);
    return answer;
  }
  /// The same in the clear.
  [[nodiscard]] Answer ask(const Metadata& metadata = {}) {
    return ask(grpc::InsecureChannelCredentials(), metadata);
  }
  static Metadata bearer(const std::string& token) { return {{"authorization", "Bearer " + token}}; }

  /// TLS for a client that trusts `authority`, with a certificate of its own if there is one.
  static std::shared_ptr<grpc::ChannelCredentials> tls(const TestAuthority& authority,
                                                       const CertificateFiles& own = {}) {
    grpc::SslCredentialsOptions options;
    options.pem_root_certs = read_file(authority.certificate());
    if (!own.key.empty()) {
      options.pem_private_key = read_file(own.key);
      options.pem_cert_chain = read_file(own.certificate);
    }
    return grpc::SslCredentials(options);
  }
  static std::vector<std::string> tls_flags(const CertificateFiles& files) {
    return {"--tls-certificate", files.certificate, "--tls-key", files.key};
  }

  /// Runs the server to its end and returns what it printed; for what answers no calls.
  struct Run {
    int exit_code;
    std::string output;
    [[nodiscard]] bool said(const std::string& text) const { return output.find(text) != std::string::npos; }
  };
  [[nodiscard]] Run run(const std::vector<std::string>& flags) {
    std::vector<std::string> arguments = {MARBLE_SERVER_BINARY};
    arguments.insert(arguments.end(), flags.begin(), flags.end());
    ChildProcess process(arguments, directory_.file("output " + std::to_string(++runs_)));
    const int exit_code = process.wait();
    return {exit_code, process.output()};
  }

  /// A new token as `marble-server --new-token` makes it.
  struct Token {
    std::string secret, line;
  };
  [[nodiscard]] Token new_token(const std::string& name_and_roles) {
    const Run made = run({"--new-token", name_and_roles});
    EXPECT_EQ(made.exit_code, 0) << made.output;
    const std::size_t first_end = made.output.find('\n');
    return {made.output.substr(0, first_end), made.output.substr(first_end + 1)};
  }

  std::string write(const std::string& name, const std::string& content) {
    std::string path = directory_.file(name);
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }
  [[nodiscard]] bool eventually_logged(const std::vector<std::string>& texts) {
    return eventually([&] { return !server().log_lines(texts).empty(); });
  }

  TemporaryDirectory directory_;

 private:
  int runs_ = 0;
};

}  // namespace marble::testing
