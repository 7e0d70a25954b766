#include "base/trace_context.h"

#include <gtest/gtest.h>

#include <string>

namespace marble::server {
namespace {

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

}  // namespace
}  // namespace marble::server
