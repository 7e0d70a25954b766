// Requests that break a rule: the field, its index and the rule come back, and the server lives on.
#include <functional>
#include <limits>

#include "service_test.h"

namespace marble::testing {
namespace {

struct Fault {
  const char* name;
  std::function<void(v1::SolveRequest&)> make;
  const char* field;  // as BadRequest reports it
  const char* rule;   // part of its description
};

void PrintTo(const Fault& fault, std::ostream* out) { *out << fault.name; }

class Malformed : public ServiceTest, public ::testing::WithParamInterface<Fault> {};

TEST_P(Malformed, IsRefusedWithFieldIndexAndRule) {
  start();
  v1::SolveRequest request = example_request();
  GetParam().make(request);
  v1::SolveResponse response;
  const grpc::Status status = solve(request, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << status.error_message();
  EXPECT_EQ(bad_field(status).field(), GetParam().field);
  EXPECT_NE(bad_field(status).description().find(GetParam().rule), std::string::npos)
      << bad_field(status).description();

  Stream stream(solver(), request);
  EXPECT_FALSE(stream.next().has_value());
  const grpc::Status streamed = stream.finish();
  EXPECT_EQ(streamed.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bad_field(streamed).field(), std::string("solve.") + GetParam().field);

  EXPECT_TRUE(lives());
  EXPECT_EQ(counters().refused_total(), 2);
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

INSTANTIATE_TEST_SUITE_P(
    Request, Malformed,
    ::testing::Values(
        Fault{"NoProblem", [](auto& r) { r.clear_problem(); }, "problem.gradient", "must have at least 1"},
        Fault{"NoVariables", [](auto& r) { r.mutable_problem()->clear_gradient(); }, "problem.gradient",
              "must have at least 1"},
        Fault{"WrongRows", [](auto& r) { r.mutable_problem()->mutable_equality_matrix()->set_rows(3); },
              "problem.equality_matrix.rows", "must be 1"},
        Fault{"WrongColumns", [](auto& r) { r.mutable_problem()->mutable_left_matrix()->set_columns(5); },
              "problem.left_matrix.columns", "must be 4"},
        Fault{"NegativeRows", [](auto& r) { r.mutable_problem()->mutable_hessian()->set_rows(-4); },
              "problem.hessian.rows", "must be 4"},
        Fault{"OffsetWithoutMatrix", [](auto& r) { r.mutable_problem()->clear_inequality_matrix(); },
              "problem.inequality_matrix.rows", "must be 1"},
        Fault{"OneSidedPair", [](auto& r) { r.mutable_problem()->clear_right_offset(); },
              "problem.right_offset", "must have 1 entries"},
        Fault{"RowOutOfRange",
              [](auto& r) { r.mutable_problem()->mutable_equality_matrix()->set_row_indices(0, 7); },
              "problem.equality_matrix.row_indices[0]", "is 7, must be in [0, 1)"},
        Fault{"NegativeRow", [](auto& r) { r.mutable_problem()->mutable_hessian()->set_row_indices(2, -1); },
              "problem.hessian.row_indices[2]", "is -1, must be in [0, 4)"},
        Fault{"PointersFall",
              [](auto& r) { r.mutable_problem()->mutable_hessian()->set_column_pointers(2, 0); },
              "problem.hessian.column_pointers[2]", "must be in [1, 4]"},
        Fault{"PointersBeyondTheEnd",
              [](auto& r) { r.mutable_problem()->mutable_hessian()->set_column_pointers(4, 2'000'000'000); },
              "problem.hessian.column_pointers[4]", "must be in [3, 4]"},
        Fault{
            "TooFewPointers",
            [](auto& r) { r.mutable_problem()->mutable_hessian()->mutable_column_pointers()->RemoveLast(); },
            "problem.hessian.column_pointers", "must have 5 entries"},
        Fault{"ValuesMissing",
              [](auto& r) { r.mutable_problem()->mutable_hessian()->mutable_values()->RemoveLast(); },
              "problem.hessian.values", "must have 4 entries"},
        Fault{"NanInGradient", [](auto& r) { r.mutable_problem()->set_gradient(2, kNan); },
              "problem.gradient[2]", "is nan, must be finite"},
        Fault{"NanInMatrix",
              [](auto& r) { r.mutable_problem()->mutable_right_matrix()->set_values(0, kNan); },
              "problem.right_matrix.values[0]", "is nan, must be finite"},
        Fault{"InfiniteBound", [](auto& r) { r.mutable_problem()->set_inequality_offset(0, kInfinity); },
              "problem.inequality_offset[0]", "is inf, must be finite"},
        Fault{"InfiniteConstant", [](auto& r) { r.mutable_problem()->set_constant(-kInfinity); },
              "problem.constant", "is -inf, must be finite"},
        Fault{"AsymmetricHessian",
              [](auto& r) { r.mutable_problem()->mutable_hessian()->set_row_indices(1, 0); },
              "problem.hessian.values[1]", "symmetric"},
        Fault{"BelowTheDiagonal",
              [](auto& r) {
                r.mutable_problem()->set_hessian_form(v1::HESSIAN_FORM_UPPER_TRIANGLE);
                r.mutable_problem()->mutable_hessian()->set_row_indices(0, 1);
              },
              "problem.hessian.row_indices[0]", "upper triangle"},
        Fault{"InitialPointTooShort", [](auto& r) { r.mutable_initial_point()->add_z(0.0); },
              "initial_point.z", "must have 4 entries"},
        Fault{"NanInInitialPoint",
              [](auto& r) {
                for (const double z : {0.0, 0.0, 0.0, kNan}) r.mutable_initial_point()->add_z(z);
              },
              "initial_point.z[3]", "is nan, must be finite"},
        Fault{"WarmStartWithoutMultipliers",
              [](auto& r) {
                for (int k = 0; k < 4; ++k) r.mutable_warm_start()->add_z(0.0);
              },
              "warm_start.equality_multipliers", "must have 1 entries"},
        Fault{"OptionOutOfRange", [](auto& r) { r.mutable_options()->set_kappa_factor(1.5); },
              "options.kappa_factor", "is 1.5"},
        Fault{"OptionNan", [](auto& r) { r.mutable_options()->set_equality_tolerance(kNan); },
              "options.equality_tolerance", "is nan"},
        Fault{"UnknownPath", [](auto& r) { r.mutable_options()->set_path(static_cast<v1::Path>(99)); },
              "options.path", "must be"},
        Fault{"MethodForResearch", [](auto& r) { r.mutable_options()->set_method(v1::METHOD_ALAG); },
              "options.method", "must be marble"},
        Fault{"NegativePath", [](auto& r) { r.mutable_options()->set_path(static_cast<v1::Path>(-3)); },
              "options.path", "must be"},
        Fault{"RequestIdTooLong", [](auto& r) { r.set_request_id(std::string(129, 'x')); }, "request_id",
              "at most 128 bytes"},
        Fault{"RequestIdNotPrintable", [](auto& r) { r.set_request_id("a\nb"); }, "request_id",
              "printable ASCII"},
        Fault{"NameTooLong", [](auto& r) { r.mutable_problem()->set_name(std::string(257, 'x')); },
              "problem.name", "at most 256 bytes"}),
    [](const auto& test) { return std::string(test.param.name); });

class MalformedStream : public ServiceTest {};

TEST_F(MalformedStream, ProgressIntervalMustBeANumberNotBelowZero) {
  start();
  for (const double interval : {-1.0, kNan}) {
    v1::SolveStreamRequest request;
    *request.mutable_solve() = example_request();
    request.set_progress_interval_s(interval);
    Stream stream(solver(), request);
    const grpc::Status status = stream.finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_EQ(bad_field(status).field(), "progress_interval_s");
  }
}

TEST_F(MalformedStream, IterateEveryMustNotBeNegative) {
  start();
  v1::SolveStreamRequest request;
  *request.mutable_solve() = example_request();
  request.set_iterate_every(-1);
  Stream stream(solver(), request);
  EXPECT_EQ(bad_field(stream.finish()).field(), "iterate_every");
}

class Noise : public ServiceTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(Noise, IsRefusedAndTheServerLives) {
  start();
  std::string noise(10'000'000, '\0');
  std::uint32_t state = 1;
  for (char& byte : noise) {
    state = 1664525U * state + 1013904223U;
    byte = static_cast<char>(state >> 24);
  }
  const std::string whole = example_request().SerializeAsString();
  for (const std::string& bytes : {noise, noise.substr(0, 1000), whole.substr(0, whole.size() - 3)}) {
    const grpc::Status status = raw_call(channel(), GetParam(), bytes).status;
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << status.error_message();
    EXPECT_NE(status.error_message().find("not a marble.v1"), std::string::npos) << status.error_message();
    EXPECT_TRUE(lives());
  }
  EXPECT_EQ(counters().refused_total(), 3);
}

INSTANTIATE_TEST_SUITE_P(Bytes, Noise,
                         ::testing::Values("/marble.v1.Solver/Solve", "/marble.v1.Solver/SolveStream"),
                         [](const auto& test) { return test.index == 0 ? "Solve" : "SolveStream"; });

}  // namespace
}  // namespace marble::testing
