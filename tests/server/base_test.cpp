#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <thread>

#include "base/status.h"
#include "base/trace_context.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "http/port_probe.h"
#include "marble/v1/fault.pb.h"
#include "support/loopback.h"

namespace marble::server {
namespace {

google::rpc::Status details_of(const grpc::Status& status) {
  google::rpc::Status details;
  EXPECT_TRUE(details.ParseFromString(status.error_details()));
  return details;
}

TEST(ErrorStatus, ABadFieldComesWithPathIndexValueAndRule) {
  const Error error{ErrorCode::invalid_argument, "problem.gradient", 3, "nan", "must be finite"};
  const grpc::Status status = to_status(error);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(status.error_message(), error.message());
  const google::rpc::Status details = details_of(status);
  EXPECT_EQ(details.code(), static_cast<int>(grpc::StatusCode::INVALID_ARGUMENT));
  ASSERT_EQ(details.details_size(), 2);
  EXPECT_EQ(details.details(0).type_url(), "type.googleapis.com/google.rpc.BadRequest");
  google::rpc::BadRequest bad_request;
  ASSERT_TRUE(details.details(0).UnpackTo(&bad_request));
  EXPECT_EQ(bad_request.field_violations(0).field(), "problem.gradient[3]");
  EXPECT_EQ(bad_request.field_violations(0).description(), "is nan, must be finite");
  v1::Fault fault;
  ASSERT_TRUE(details.details(1).UnpackTo(&fault));
  EXPECT_EQ(fault.field(), "problem.gradient");
  EXPECT_EQ(fault.index(), 3);
  EXPECT_EQ(fault.value(), "nan");
  EXPECT_EQ(fault.bound(), "must be finite");
}

TEST(ErrorStatus, AFullQueueReportsWhenToRetry) {
  const grpc::Status status = to_status({ErrorCode::resource_exhausted, "queue_jobs", -1, "", "full"}, 2.25);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  google::rpc::RetryInfo retry;
  const google::rpc::Status details = details_of(status);
  ASSERT_EQ(details.details_size(), 2);
  v1::Fault fault;
  ASSERT_TRUE(details.details(0).UnpackTo(&fault));
  EXPECT_EQ(fault.field(), "queue_jobs");
  EXPECT_FALSE(fault.has_index());
  ASSERT_TRUE(details.details(1).UnpackTo(&retry));
  EXPECT_EQ(retry.retry_delay().seconds(), 2);
  EXPECT_EQ(retry.retry_delay().nanos(), 250'000'000);
}

TEST(ErrorStatus, EveryCodeHasItsOwnStatus) {
  std::vector<grpc::StatusCode> seen;
  for (int i = 0; i <= static_cast<int>(ErrorCode::internal); ++i) {
    const grpc::StatusCode code = to_status({static_cast<ErrorCode>(i), "", -1, "", ""}).error_code();
    EXPECT_NE(code, grpc::StatusCode::OK);
    EXPECT_NE(code, grpc::StatusCode::UNKNOWN);
    EXPECT_EQ(std::count(seen.begin(), seen.end(), code), 0);
    seen.push_back(code);
  }
}

const std::string kSpan = "1122334455667788";
const std::string kTrace = "4bf92f3577b34da6a3ce929d0e0e4736";
const std::string kParent = "00f067aa0ba902b7";
const std::string kIds = kTrace + "-" + kParent;  // the example of the standard

TEST(TraceContext, TakesTheStandardsExamples) {
  for (const char* flags : {"01", "00"}) {
    const auto trace = parse_traceparent("00-" + kIds + "-" + flags, kSpan);
    ASSERT_TRUE(trace) << flags;
    EXPECT_EQ(trace->trace_id, kTrace);
    EXPECT_EQ(trace->parent_span_id, kParent);
    EXPECT_EQ(trace->span_id, kSpan);
    EXPECT_EQ(to_traceparent(*trace), "00-" + kTrace + "-" + kSpan + "-" + flags);
  }
}

TEST(TraceContext, PassesOnOnlyTheFlagsThatItKnows) {
  EXPECT_EQ(to_traceparent(parse_traceparent("00-" + kIds + "-ff", kSpan).value()).substr(53), "03");
  EXPECT_EQ(to_traceparent(parse_traceparent("00-" + kIds + "-08", kSpan).value()).substr(53), "00");
}

TEST(TraceContext, TakesWhatItKnowsOfALaterVersion) {
  for (const char* more : {"", "-", "-what-the-future-will-be-like", "-00"}) {
    const auto trace = parse_traceparent("cc-" + kIds + "-01" + more, kSpan);
    ASSERT_TRUE(trace) << more;
    EXPECT_EQ(to_traceparent(*trace), "00-" + kTrace + "-" + kSpan + "-01")
        << "reported in the version it knows";
  }
  EXPECT_FALSE(parse_traceparent("cc-" + kIds + "-01.what", kSpan));
  EXPECT_FALSE(parse_traceparent("cc-" + kIds + "-0", kSpan));
}

TEST(TraceContext, IgnoresWhatIsNone) {
  const std::string no_trace(32, '0');
  const std::string no_span(16, '0');
  for (const std::string& text : {
           std::string(),
           std::string("00"),
           "ff-" + kIds + "-01",                      // the version that is forbidden
           "00-" + no_trace + "-" + kParent + "-01",  // ids of nothing
           "00-" + kTrace + "-" + no_span + "-01",    //
           "00-" + kIds + "-01-",                     // version 00 ends here
           "00-" + kIds + "-01-extra",                //
           "00-" + kIds + "-1",                       // too short
           "00-" + kIds + "-0x",                      // no digits
           "0g-" + kIds + "-01",                      //
           "00-g" + kIds.substr(1) + "-01",           //
           "00-" + kTrace + "-" + kParent.substr(1) + "G-01",
           "00-4BF92F3577B34DA6A3CE929D0E0E4736-" + kParent + "-01",  // upper case
           "00_" + kIds + "-01",
           "00-" + kTrace + "_" + kParent + "-01",
           "00-" + kIds + "_01",
           " 00-" + kIds + "-01",
           "00-" + kIds + "-01 ",
       }) {
    EXPECT_FALSE(parse_traceparent(text, kSpan)) << text;
  }
}

TEST(TraceContext, IgnoresEveryTextThatWasCutOrHasOneByteReplaced) {
  const std::string good = "00-" + kIds + "-01";
  for (std::size_t i = 0; i < good.size(); ++i) {
    EXPECT_FALSE(parse_traceparent(good.substr(0, i), kSpan)) << i;
    for (const char bad : {'\0', ' ', 'x', '\xff'}) {
      std::string text = good;
      text[i] = bad;
      EXPECT_FALSE(parse_traceparent(text, kSpan)) << i;
    }
  }
}

// Who accepts at a port, and who does not.
class PortProbe : public ::testing::Test {
 protected:
  PortProbe() { testing::listen_on(listener_, testing::loopback()); }
  ~PortProbe() override { close(listener_); }

  const int listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
};

TEST_F(PortProbe, SeesThatNobodyAccepts) {
  EXPECT_FALSE(ports_answer({listener_}, false, std::chrono::milliseconds(100)));
  EXPECT_FALSE(ports_answer({listener_}, true, std::chrono::milliseconds(100)));
}

TEST_F(PortProbe, WhoHangsUpAcceptsToo) {
  std::thread other([&] { close(accept(listener_, nullptr, nullptr)); });
  EXPECT_TRUE(ports_answer({listener_}, false, std::chrono::minutes(1)));
  other.join();
}

}  // namespace
}  // namespace marble::server
