// Heads of requests to solve: what any encoding of a request says, and what is left to the whole parser.
#include "service/solve_head.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/wire.h"

namespace marble::server {
namespace {

using std::string_literals::operator""s;  // with zeros

grpc::ByteBuffer buffer_of(const std::string& bytes, std::size_t first = 0) {
  const std::vector<grpc::Slice> slices = {grpc::Slice(bytes.substr(0, first)),
                                           grpc::Slice(bytes.substr(first))};
  return {slices.data(), slices.size()};
}

std::string field(int number, const std::string& bytes) {  // of less than 16 KiB
  const std::size_t size = bytes.size();
  std::string out(1, static_cast<char>(8 * number + 2));
  if (size >= 128) out += static_cast<char>(size % 128 + 128);
  out += static_cast<char>(size < 128 ? size : size / 128);
  return out + bytes;
}

v1::SolveRequest request() {
  v1::SolveRequest message;
  for (int k = 0; k < 100; ++k) message.mutable_problem()->add_gradient(k);
  message.mutable_options()->set_max_iterations(7);
  message.mutable_options()->set_time_limit_s(2.5);
  message.set_request_id("plan 9");
  message.set_priority(v1::PRIORITY_BATCH);
  return message;
}

// The head of the bytes, which is that of the message that they are.
std::optional<SolveHead> same_head(const std::string& bytes) {
  const auto head = read_head(buffer_of(bytes));
  v1::SolveRequest whole;
  EXPECT_TRUE(whole.ParseFromString(bytes));
  if (!head) return head;
  EXPECT_EQ(head->fields.priority(), whole.priority());
  EXPECT_EQ(head->fields.request_id(), whole.request_id());
  EXPECT_EQ(head->fields.has_options(), whole.has_options());
  EXPECT_EQ(head->fields.options().SerializeAsString(), whole.options().SerializeAsString());
  return head;
}

bool is_unreadable(const std::string& bytes) { return !read_head(buffer_of(bytes)).has_value(); }

TEST(SolveHead, HasOptionsIdPrioritySizeAndNothingElse) {
  const std::string bytes = request().SerializeAsString();
  for (std::size_t first = 0; first <= bytes.size(); ++first) {
    const auto head = read_head(buffer_of(bytes, first));
    ASSERT_TRUE(head.has_value()) << first;
    v1::SolveRequest expected = request();
    expected.clear_problem();
    EXPECT_EQ(head->fields.SerializeAsString(), expected.SerializeAsString()) << first;
    EXPECT_EQ(head->bytes, static_cast<std::int64_t>(request().ByteSizeLong()));
  }
  const grpc::ByteBuffer empty;
  ASSERT_TRUE(read_head(empty).has_value());
  EXPECT_EQ(read_head(empty)->bytes, 0);
}

TEST(SolveHead, OfAStreamIsThatOfItsRequestInOneOrMoreParts) {
  const int solve = v1::SolveStreamRequest::kSolveFieldNumber;
  v1::SolveStreamRequest stream;
  *stream.mutable_solve() = request();
  stream.set_progress_interval_s(0.5);
  stream.set_iterate_every(2);
  const std::string bytes = stream.SerializeAsString();
  const auto head = read_head(buffer_of(bytes), solve);
  ASSERT_TRUE(head.has_value());
  EXPECT_EQ(head->fields.options().max_iterations(), 7);
  EXPECT_EQ(head->bytes, static_cast<std::int64_t>(request().ByteSizeLong()));
  const std::string realtime = field(solve, "\x28\x01");
  const auto divided = read_head(buffer_of(bytes + realtime), solve);
  ASSERT_TRUE(divided.has_value());
  EXPECT_EQ(divided->fields.priority(), v1::PRIORITY_REALTIME);
  EXPECT_EQ(divided->fields.request_id(), "plan 9");
  EXPECT_EQ(divided->bytes, head->bytes + 2);
  const auto none = read_head(buffer_of("\x18\x02"), solve);
  ASSERT_TRUE(none.has_value()) << "without a request";
  EXPECT_EQ(none->bytes, 0);
  for (std::size_t size = 1; size < stream.solve().ByteSizeLong(); ++size)
    EXPECT_FALSE(read_head(buffer_of(bytes.substr(0, size)), solve).has_value()) << size;
  for (const std::string& damaged :
       {"\x0a\x04\x28\x01"s, "\x0a\x03\x22\x05\x61\x18\x02\x18\x02"s, "\x0a\xff\xff\xff\xff\x07\x28\x01"s,
        "\x0a\xff\xff\xff\xff\x0f\x28\x01"s, "\x0a\x03\x28\x01\x4c"s, "\x0a\x03\x28\x01\xa8\x80\x00\x02"s})
    EXPECT_FALSE(read_head(buffer_of(damaged), solve).has_value()) << ::testing::PrintToString(damaged);
}

TEST(SolveHead, RepeatedFieldsCountAsTheWholeParserCountsThem) {
  v1::SolveRequest more;
  more.mutable_options()->set_max_iterations(9);
  more.mutable_options()->set_num_starts(3);
  more.set_priority(v1::PRIORITY_REALTIME);
  const auto merged = same_head(request().SerializeAsString() + more.SerializeAsString());
  ASSERT_TRUE(merged.has_value());
  EXPECT_EQ(merged->fields.options().max_iterations(), 9);
  EXPECT_EQ(merged->fields.options().time_limit_s(), 2.5);
  EXPECT_EQ(merged->fields.priority(), v1::PRIORITY_REALTIME);
  EXPECT_TRUE(same_head(request().SerializeAsString() + field(4, "") + field(2, "") + "\x28\x00"s));
}

TEST(SolveHead, AFieldOfAnotherWireTypeIsUnknown) {
  const std::string batch = "\x28\x03";
  for (const std::string& other :
       {"\x2d\x81\x80\x80\x00"s, "\x29\x81\x80\x80\x80\x80\x80\x80\x00"s, field(5, "\x01"), "\x10\x05"s,
        "\x15\x01\x02\x03\x04"s, "\x11\x01\x02\x03\x04\x05\x06\x07\x08"s, "\x20\x07"s,
        field(2, "\x15\x01\x02\x03\x04"s), field(99 / 8, "what"), "\xc0\x3e\x01"s}) {
    const auto head = same_head(batch + other);
    ASSERT_TRUE(head.has_value()) << ::testing::PrintToString(other);
    EXPECT_EQ(head->fields.priority(), v1::PRIORITY_BATCH) << ::testing::PrintToString(other);
  }
}

TEST(SolveHead, NumbersMayBeLongerThanTheyNeed) {
  for (const std::string& batch :
       {"\x28\x83\x00"s, "\x28\x83\x80\x80\x80\x80\x80\x80\x80\x80\x00"s, "\x28\x83\x80\x80\x80\x20"s,
        "\xa8\x00\x03"s, "\xa8\x80\x80\x80\x00\x03"s}) {
    const auto head = same_head(batch);
    ASSERT_TRUE(head.has_value()) << ::testing::PrintToString(batch);
    EXPECT_EQ(head->fields.priority(), v1::PRIORITY_BATCH);
  }
  ASSERT_TRUE(same_head("\x28\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01"s).has_value());
  EXPECT_TRUE(same_head("\x12\x84\x80\x00\x10\x85\x80\x00"s).has_value());
  EXPECT_TRUE(is_unreadable("\x28\x83\x80\x80\x80\x80\x80\x80\x80\x80\x80\x00"s)) << "of 11 bytes";
}

TEST(SolveHead, WhatIsDamagedHasNone) {
  const std::string bytes = request().SerializeAsString();
  v1::SolveRequest whole;
  for (std::size_t size = 1; size < bytes.size(); ++size) {
    const std::string part = bytes.substr(0, size);
    EXPECT_EQ(is_unreadable(part), !whole.ParseFromString(part)) << size;
  }
  for (const std::string& damaged :
       {"\x00"s, "\x02\x00"s, "\x2c"s, "\x2e\x01"s, "\x2f\x01"s, "\x12\x02\x10\x80"s,
        "\x12\xff\xff\xff\xff\x0f"s, "\x0a\xff\xff\xff\xff\x07\x01"s}) {
    EXPECT_TRUE(is_unreadable(bytes + damaged)) << ::testing::PrintToString(damaged);
    EXPECT_TRUE(is_unreadable(damaged + bytes)) << ::testing::PrintToString(damaged);
  }
}

TEST(SolveHead, WhatNeedsManyStepsIsLeftToTheWholeParser) {
  EXPECT_TRUE(is_unreadable("\x4b\x4c"s)) << "a group";
  EXPECT_TRUE(is_unreadable("\x28\x01\xfb\x06\x28\x02\xfc\x06"s)) << "an unknown group with a priority";
  std::string many;
  for (int k = 0; k < kMostFields; ++k) many += "\x28\x02";
  EXPECT_TRUE(same_head(many).has_value());
  EXPECT_TRUE(is_unreadable(many + "\x28\x02"));
  const std::string most(kMostHeadBytes / 2, 'i');
  EXPECT_TRUE(same_head(field(4, most) + field(4, most)).has_value());
  EXPECT_TRUE(is_unreadable(field(4, most) + field(4, most) + field(4, "i")));
  const std::string unknown = field(2, field(15, most.substr(4)));
  EXPECT_TRUE(same_head(unknown + unknown).has_value());
  EXPECT_TRUE(is_unreadable(unknown + unknown + unknown)) << "of options, whose unknown fields are kept";
}

}  // namespace
}  // namespace marble::server
