#include "marble/convert.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <random>
#include <set>
#include <string>

#include "marble/v1/fault.pb.h"
#include "marble/v1/service.pb.h"
#include "marble/v1/session.pb.h"
#include "message_json.h"
#include "problems.h"

namespace marble {
namespace {

using google::protobuf::FieldDescriptor;

FieldDescriptor::CppType type_of(OptionType type) {
  switch (type) {
    case OptionType::real:
      return FieldDescriptor::CPPTYPE_DOUBLE;
    case OptionType::integer:
      return FieldDescriptor::CPPTYPE_INT32;
    case OptionType::boolean:
      return FieldDescriptor::CPPTYPE_BOOL;
    case OptionType::choice:
      return FieldDescriptor::CPPTYPE_ENUM;
  }
  return FieldDescriptor::CPPTYPE_MESSAGE;
}

TEST(Convert, SolveOptionsHasExactlyTheTablesOptionsWithTheirTypes) {
  const auto* message = v1::SolveOptions::descriptor();
  EXPECT_EQ(message->field_count(), static_cast<int>(option_table().size()));
  for (const OptionInfo& option : option_table()) {
    const FieldDescriptor* field = message->FindFieldByName(std::string(option.name));
    ASSERT_NE(field, nullptr) << option.name;
    EXPECT_EQ(field->cpp_type(), type_of(option.type)) << option.name;
    EXPECT_TRUE(field->has_presence()) << option.name;
    if (option.type != OptionType::choice) continue;
    const auto* choices = field->enum_type();
    ASSERT_EQ(choices->value_count(), static_cast<int>(option.choices.size()) + 1) << option.name;
    for (int i = 0; i < static_cast<int>(option.choices.size()); ++i) {
      std::string name =
          option.name.data() + std::string("_").append(option.choices[static_cast<std::size_t>(i)]);
      for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
      ASSERT_NE(choices->FindValueByNumber(i + 1), nullptr);
      EXPECT_EQ(choices->FindValueByNumber(i + 1)->name(), name);
    }
  }
}

TEST(Convert, OptionsComeBackAsTheyWere) {
  Options options;
  for (const OptionInfo& option : option_table()) {
    const double middle = option.type == OptionType::real ? 0.5 * (option.low + option.high) : option.high;
    ASSERT_TRUE(set_option(options, option.name, middle)) << option.name;
  }
  v1::SolveOptions message;
  to_message(options, &message);
  const auto back = options_of(message);
  ASSERT_TRUE(back.has_value()) << back.error().message();
  for (const OptionInfo& option : option_table()) {
    EXPECT_EQ(get_option(*back, option.name), get_option(options, option.name)) << option.name;
  }
}

TEST(Convert, AbsentOptionsHaveTheirDefaults) {
  const auto options = options_of(v1::SolveOptions());
  ASSERT_TRUE(options.has_value());
  for (const OptionInfo& option : option_table()) {
    EXPECT_EQ(get_option(*options, option.name), option.default_value) << option.name;
  }
}

TEST(Convert, AnUnspecifiedChoiceIsAnAbsentOne) {
  v1::SolveOptions message;
  message.set_path(v1::PATH_UNSPECIFIED);
  const auto options = options_of(message);
  ASSERT_TRUE(options.has_value());
  EXPECT_EQ(options->path, Options().path);
}

// A client in static storage is destroyed after what its first use created; its workers convert until then.
TEST(Convert, OptionsAreConvertedWhileTheProcessExits) {
  struct ConvertsAtExit {
    ~ConvertsAtExit() {
      v1::SolveOptions message;
      to_message(Options{.max_iterations = 7}, &message);
      if (message.max_iterations() != 7) std::abort();
    }
  };
  static const ConvertsAtExit converts_at_exit;
  v1::SolveOptions message;
  to_message(Options{}, &message);
  EXPECT_TRUE(options_of(message).has_value());
}

TEST(Convert, OptionsOutOfRangeAreNamed) {
  v1::SolveOptions message;
  message.set_kappa_min(-1.0);
  const auto options = options_of(message);
  ASSERT_FALSE(options.has_value());
  EXPECT_EQ(options.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(options.error().field, "kappa_min");
}

TEST(Convert, AProblemIsViewedInPlace) {
  const v1::SolveRequest request = testing::example_request();
  const v1::Problem& message = request.problem();
  const ProblemView view = view_of(message);
  EXPECT_EQ(view.g.data(), message.gradient().data());
  EXPECT_EQ(view.Q.values.data(), message.hessian().values().data());
  EXPECT_EQ(view.Q.row_indices.data(), message.hessian().row_indices().data());
  EXPECT_EQ(view.R.column_pointers.data(), message.right_matrix().column_pointers().data());
  EXPECT_EQ(view.r.data(), message.right_offset().data());
}

TEST(Convert, AProblemComesBackAsItWas) {
  v1::Problem message = testing::long_request().problem();
  message.set_constant(7.5);
  message.set_hessian_form(v1::HESSIAN_FORM_UPPER_TRIANGLE);
  v1::Problem copy;
  to_message(view_of(message), &copy);
  copy.set_name(message.name());
  EXPECT_EQ(copy.SerializeAsString(), message.SerializeAsString());
}

TEST(Convert, FieldNamesHaveAWayBack) {
  const auto* problem = v1::Problem::descriptor();
  for (const char* core : {"Q", "g", "c0", "A", "b", "C", "d", "L", "l", "R", "r"}) {
    const std::string name = message_field(core);
    EXPECT_NE(problem->FindFieldByName(name), nullptr) << core << " → " << name;
    EXPECT_EQ(core_field(name), core);
    EXPECT_EQ(core_field(name + ".values"), std::string(core) + ".values");
    EXPECT_EQ(message_field(std::string(core) + ".row_indices"), name + ".row_indices");
  }
  EXPECT_EQ(message_field("something_else"), "something_else");
}

TEST(Convert, EveryStatusHasItsNamesakeAndComesBack) {
  for (int i = 0; i <= static_cast<int>(Status::numerical_failure); ++i) {
    const auto status = static_cast<Status>(i);
    std::string name = std::string("STATUS_") + to_string(status);
    for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    EXPECT_EQ(v1::Status_Name(to_message(status)), name);
    EXPECT_EQ(status_of(to_message(status)), status);
  }
}

// Of a Solution the service and the calls return these beside the solution; derivatives have their own form.
const std::set<std::string> kBeside = {"options", "coupled", "scenarios",
                                       "queue_s", "total_s", "sensitivity"};

// Gives every other field a value of its own, also those of the messages in it.
void fill(google::protobuf::Message& message, int& next) {
  const auto* reflection = message.GetReflection();
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor* field = message.GetDescriptor()->field(i);
    if (kBeside.contains(field->name())) continue;
    ++next;
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
        if (!field->is_repeated()) {
          reflection->SetDouble(&message, field, next + 0.5);
        } else {
          for (const double value : {next + 0.5, -0.0, std::numeric_limits<double>::denorm_min()})
            reflection->AddDouble(&message, field, value);
        }
        break;
      case FieldDescriptor::CPPTYPE_INT32:
        if (field->is_repeated()) {
          reflection->AddInt32(&message, field, next);
        } else {
          reflection->SetInt32(&message, field, next);
        }
        break;
      case FieldDescriptor::CPPTYPE_INT64:
        reflection->SetInt64(&message, field, 5000000000 + next);
        break;
      case FieldDescriptor::CPPTYPE_BOOL:
        reflection->SetBool(&message, field, true);
        break;
      case FieldDescriptor::CPPTYPE_STRING:
        reflection->SetString(&message, field, "text " + std::to_string(next));
        break;
      case FieldDescriptor::CPPTYPE_ENUM:
        reflection->SetEnumValue(&message, field, field->enum_type()->value_count() - 1);
        break;
      case FieldDescriptor::CPPTYPE_MESSAGE:
        fill(*reflection->MutableMessage(&message, field), next);
        break;
      default:
        FAIL() << field->full_name() << " has a type that this test does not know";
    }
  }
}

TEST(Convert, EveryFieldOfASolutionComesBackAsItWas) {
  v1::Solution message;
  int next = 0;
  fill(message, next);
  v1::Solution back;
  to_message(solution_of(message), &back);
  EXPECT_EQ(back.DebugString(), message.DebugString());
  EXPECT_EQ(back.SerializeAsString(), message.SerializeAsString());
}

TEST(Convert, WithoutATreeNothingOfOneIsSentAndItComesBackUnknown) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  v1::Solution answer;
  to_message(Solution{}, &answer);
  v1::Progress row;
  to_message(Progress{}, &row);
  for (const char* field : {"incumbent", "bound", "gap", "nodes", "open_nodes", "proved"}) {
    for (const google::protobuf::Message* message :
         {static_cast<google::protobuf::Message*>(&answer), static_cast<google::protobuf::Message*>(&row)}) {
      const FieldDescriptor* found = message->GetDescriptor()->FindFieldByName(field);
      EXPECT_FALSE(found != nullptr && message->GetReflection()->HasField(*message, found)) << field;
    }
  }
  EXPECT_EQ(solution_of(answer).bound, -kInfinity);
  EXPECT_EQ(solution_of(answer).gap, kInfinity);
  EXPECT_EQ(progress_of(row).incumbent, kInfinity);
  EXPECT_EQ(progress_of(row).bound, -kInfinity);
}

TEST(Convert, TheBoundOfAProblemThatIsProvedInfeasibleIsInfiniteThereToo) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Solution solution;
  solution.proved = true;
  solution.bound = kInfinity;
  v1::Solution message;
  to_message(solution, &message);
  v1::Solution sent;
  ASSERT_TRUE(sent.ParseFromString(message.SerializeAsString()));
  EXPECT_EQ(solution_of(sent).bound, kInfinity);
  EXPECT_TRUE(solution_of(sent).proved);
}

TEST(Convert, ProgressComesBackAsItWas) {
  const Progress progress = {.iteration = 1,
                             .outer_iteration = 2,
                             .objective = 3.0,
                             .violations = {4.0, 5.0, 6.0},
                             .kkt_residual = 7.0,
                             .kappa = 8.0,
                             .rho = 9.0,
                             .step_length = 0.5,
                             .regularization = 11.0,
                             .factorizations = 12,
                             .elapsed_s = 13.0,
                             .incumbent = 14.0,
                             .bound = -15.0,
                             .gap = 16.0,
                             .nodes = 17,
                             .open_nodes = 18,
                             .stage = 19,
                             .scenarios = 20,
                             .z = {}};
  v1::Progress message;
  to_message(progress, &message);
  v1::Progress again;
  to_message(progress_of(message), &again);
  EXPECT_EQ(again.SerializeAsString(), message.SerializeAsString());
  for (int i = 0; i < v1::Progress::descriptor()->field_count(); ++i) {
    const FieldDescriptor* field = v1::Progress::descriptor()->field(i);
    if (field->name() == "z") continue;
    EXPECT_TRUE(message.GetReflection()->HasField(message, field))
        << field->name() << " was not carried over";
  }
}

}  // namespace
}  // namespace marble

namespace marble::server {
namespace {

// Messages as JSON in pieces are byte for byte what protobuf makes of them.
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
