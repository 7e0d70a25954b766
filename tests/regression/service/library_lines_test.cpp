// Symptom: Jobs.Get with bytes that are no UTF-8, from a caller without a token, filled the log with
// thousands of lines a second, "[libprotobuf ERROR wire_format_lite.cc:618] ...", none of them JSON with
// --log-format json. And GetInfo answered bytes that are no message with UNIMPLEMENTED. Cause: Jobs parsed a
// request before it asked who sent it, protobuf wrote to standard error by itself, and gRPC parsed what
// GetInfo was sent.
#include <nlohmann/json.hpp>

#include "service/secure_service_test.h"

namespace marble::testing {
namespace {

using grpc::StatusCode;

class LibraryLines : public SecureServiceTest {
 protected:
  StatusCode call(const std::string& method, const std::string& bytes, const std::string& token = "") {
    return raw_call(channel(), method, bytes, token).status.error_code();
  }
  const std::vector<std::string> kMethods = {"/marble.v1.Solver/Solve", "/marble.v1.Jobs/Submit",
                                             "/marble.v1.Jobs/Result",  "/marble.v1.Jobs/Delete",
                                             "/marble.v1.Jobs/List",    "/marble.v1.Jobs/Get",
                                             "/marble.v1.Jobs/Cancel",  "/marble.v1.Server/GetInfo"};
  const std::string kNoMessage = "\x0a\xff";       // a field longer than all there is
  const std::string kNoText = "\x0a\x02\xff\xfe";  // a text that is no UTF-8
};

TEST_F(LibraryLines, WhoIsNotKnownIsReportedSoBeforeARequestIsParsed) {
  start({"--tokens", write("tokens", new_token("planner:solve").line), "--log-format", "json"});
  for (const std::string& method : kMethods) {
    for (const std::string& bytes : {kNoMessage, kNoText})
      EXPECT_EQ(call(method, bytes), StatusCode::UNAUTHENTICATED) << method;
  }
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
  EXPECT_TRUE(server().log_lines({"protobuf"}).empty()) << server().log();
}

TEST_F(LibraryLines, WhatIsNoMessageIsAnInvalidArgumentEverywhere) {
  const Token token = new_token("planner:solve,observe,admin");
  start({"--tokens", write("tokens", token.line)});
  for (const std::string& method : kMethods)
    EXPECT_EQ(call(method, kNoMessage, token.secret), StatusCode::INVALID_ARGUMENT) << method;
}

TEST_F(LibraryLines, WhatProtobufHasToSayIsALineOfOursAndLimited) {
  start({"--log-format", "json", "--log-lines-per-s", "1"});
  for (int i = 0; i < 100; ++i) EXPECT_EQ(call("/marble.v1.Jobs/Get", kNoText), StatusCode::INVALID_ARGUMENT);
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
  int lines = 0, suppressed = 0;
  for (const std::string& text : server().log_lines({})) {
    const auto line = nlohmann::json::parse(text, nullptr, false);
    ASSERT_TRUE(line.is_object()) << text;
    const bool itself = line["event"] == "protobuf";
    lines += itself ? 1 : 0;
    if (itself || line.value("of", "") == "protobuf") suppressed += line.value("suppressed", 0);
  }
  EXPECT_GT(suppressed, 0);
  EXPECT_EQ(lines + suppressed, 100);
}

}  // namespace
}  // namespace marble::testing
