// Messages as JSON in pieces are byte for byte what protobuf makes of them.
#include "message_json.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>

#include <limits>
#include <random>

#include "marble/v1/fault.pb.h"
#include "marble/v1/service.pb.h"
#include "marble/v1/session.pb.h"

namespace marble::server {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

std::string of_library(const Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string text;
  EXPECT_TRUE(google::protobuf::util::MessageToJsonString(message, &text, options).ok());
  return text;
}

std::string in_pieces(const Message& message) {
  std::string text;
  EXPECT_TRUE(write_message_json(message, [&](std::string_view piece) {
    text += piece;
    return true;
  }));
  EXPECT_EQ(message_json_size(message), text.size());
  return text;
}

class RandomMessages {
 public:
  void fill(Message* message, int depth) {
    const auto& type = *message->GetDescriptor();
    if (type.full_name() == "google.protobuf.Any") {
      v1::Fault fault;
      fault.set_field("problem.g");
      static_cast<google::protobuf::Any*>(message)->PackFrom(fault);
      return;
    }
    for (int i = 0; i < type.field_count(); ++i) {
      const FieldDescriptor& field = *type.field(i);
      const bool nested = field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
      if (random_() % 3 == 0 || (nested && depth == 0)) continue;
      const int count = field.is_repeated() ? static_cast<int>(random_() % 4) : 1;
      for (int k = 0; k < count; ++k) put(message, field, depth);
    }
  }

 private:
  double real() {
    static const std::vector<double> special = {0.0,
                                                -0.0,
                                                0.1,
                                                1e22,
                                                -1e-7,
                                                123456789012345678.0,
                                                std::numeric_limits<double>::max(),
                                                std::numeric_limits<double>::denorm_min(),
                                                std::numeric_limits<double>::infinity(),
                                                -std::numeric_limits<double>::infinity(),
                                                std::numeric_limits<double>::quiet_NaN()};
    if (random_() % 2 == 0) return special[random_() % special.size()];
    const std::uint64_t bits = (std::uint64_t{random_()} << 32U) | random_();
    return std::bit_cast<double>(bits);
  }
  std::string text() {
    static const std::vector<std::string> all = {"", "plain", "\"quoted\" \\ </script> &'", "\x01\n\t\x7f",
                                                 "\xe2\x80\xa8 \xc3\xa4 \xf0\x9f\x98\x80"};
    return all[random_() % all.size()];
  }
  void put(Message* message, const FieldDescriptor& field, int depth) {
    const auto& reflection = *message->GetReflection();
#define PUT(kind, Kind, value)                                                \
  case FieldDescriptor::kind:                                                 \
    return field.is_repeated() ? reflection.Add##Kind(message, &field, value) \
                               : reflection.Set##Kind(message, &field, value);
    switch (field.cpp_type()) {
      PUT(CPPTYPE_DOUBLE, Double, real())
      PUT(CPPTYPE_FLOAT, Float, static_cast<float>(real()))
      PUT(CPPTYPE_INT32, Int32, static_cast<std::int32_t>(random_()))
      PUT(CPPTYPE_UINT32, UInt32, static_cast<std::uint32_t>(random_()))
      PUT(CPPTYPE_INT64, Int64, static_cast<std::int64_t>(random_()) << 31)
      PUT(CPPTYPE_UINT64, UInt64, std::uint64_t{random_()} << 32U)
      PUT(CPPTYPE_BOOL, Bool, random_() % 2 == 0)
      PUT(CPPTYPE_STRING, String, text())
      PUT(CPPTYPE_ENUM, EnumValue, static_cast<int>(random_() % 4) * (random_() % 8 == 0 ? 100 : 1))
      case FieldDescriptor::CPPTYPE_MESSAGE:
        return fill(field.is_repeated() ? reflection.AddMessage(message, &field)
                                        : reflection.MutableMessage(message, &field),
                    depth - 1);
    }
#undef PUT
  }

  std::mt19937 random_{1};
};

TEST(MessageJson, IsThatOfTheLibrary) {
  RandomMessages random;
  const std::vector<const Message*> kinds = {
      &v1::SolveResponse::default_instance(),    &v1::SolveRequest::default_instance(),
      &v1::GetInfoResponse::default_instance(),  &v1::GetJobResponse::default_instance(),
      &v1::ListJobsResponse::default_instance(), &v1::WatchJobsResponse::default_instance(),
      &v1::SessionResponse::default_instance(),  &v1::JobBundleResponse::default_instance(),
      &v1::Counters::default_instance()};
  for (const Message* kind : kinds) {
    EXPECT_EQ(in_pieces(*kind), of_library(*kind)) << kind->GetTypeName();
    for (int round = 0; round < 40; ++round) {
      const std::unique_ptr<Message> message(kind->New());
      random.fill(message.get(), 3);
      ASSERT_EQ(in_pieces(*message), of_library(*message)) << kind->GetTypeName() << " in round " << round;
    }
  }
}

TEST(MessageJson, PiecesAreSmallAndEndWhereTheSinkDoes) {
  v1::SolveResponse message;
  for (int i = 0; i < 100'000; ++i) message.mutable_solution()->add_z(1.0 / (i + 1));
  std::size_t largest = 0;
  int pieces = 0;
  EXPECT_TRUE(write_message_json(message, [&](std::string_view piece) {
    largest = std::max(largest, piece.size());
    ++pieces;
    return true;
  }));
  EXPECT_LT(largest, static_cast<std::size_t>(kJsonPieceBytes));
  EXPECT_GT(pieces, 10);
  v1::GetInfoResponse long_text;
  long_text.set_version(std::string(1 << 20, 'x'));
  EXPECT_TRUE(write_message_json(long_text, [&](std::string_view piece) {
    largest = std::max(largest, piece.size());
    return true;
  }));
  EXPECT_LT(largest, static_cast<std::size_t>(kJsonPieceBytes));
  int taken = 0;
  EXPECT_FALSE(write_message_json(message, [&](std::string_view) { return ++taken < 3; }));
  EXPECT_EQ(taken, 3);
}

}  // namespace
}  // namespace marble::server
