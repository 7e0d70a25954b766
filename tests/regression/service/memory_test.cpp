#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/wire.h"
#include "calls/session_update.h"
#include "marble/convert.h"
#include "service/bidi.h"
#include "service/http_service_test.h"
#include "service/service_test.h"
#include "support/partial_matrix.h"

namespace marble::testing {
namespace {

// Symptom: a request of 20 bytes ended the server (SIGSEGV), at every start again where its job was kept.
// Cause: matrices without rows, columns and arrays are empty; one without rows, but with columns or with
// entries, passed for empty too, and the work of coupled problems read, or wrote, where its columns said.
using BatchCall = Bidi<v1::SolveBatchRequest, v1::SolveBatchResponse>;

struct Found {
  v1::SolveRequest request;
  const char* field;
};

std::vector<Found> found() {
  std::vector<Found> all(3);
  // 20 bytes, that read out of bounds.
  v1::CoupledBlock* block = all[0].request.mutable_coupled()->add_blocks();
  block->mutable_problem()->add_gradient(1.0);
  block->mutable_coupling()->set_columns(9);
  all[0].field = "coupled.blocks[0].coupling.columns";
  // That read out of bounds where segments were cut.
  v1::Problem* problem = all[1].request.mutable_problem();
  for (int j = 0; j < 4; ++j) {
    problem->add_gradient(1.0);
    all[1].request.mutable_coupled()->mutable_segments()->add_stages(j);
  }
  problem->mutable_left_matrix()->set_columns(65536);
  all[1].request.mutable_coupled()->mutable_segments()->set_num_segments(2);
  all[1].field = "problem.left_matrix.columns";
  // That wrote out of bounds, before any queue.
  block = all[2].request.mutable_coupled()->add_blocks();
  block->mutable_problem()->add_gradient(1.0);
  block->mutable_coupling()->add_row_indices(65536);
  all[2].field = "coupled.blocks[0].coupling.columns";
  return all;
}

class PartialMatrixRequests : public HttpServiceTest {
 protected:
  [[nodiscard]] grpc::Status unary(const v1::SolveRequest& request) {
    v1::SolveResponse response;
    return solve(request, &response);
  }
  [[nodiscard]] grpc::Status streamed(const v1::SolveRequest& request) {
    grpc::ClientContext context;
    v1::SolveStreamRequest whole;
    *whole.mutable_solve() = request;
    const auto reader = solver().SolveCoupled(&context, whole);
    for (Event event; reader->Read(&event);) {
    }
    return reader->Finish();
  }
  [[nodiscard]] grpc::Status submitted(const v1::SolveRequest& request) {
    grpc::ClientContext context;
    v1::SubmitResponse response;
    return v1::Jobs::NewStub(channel())->Submit(&context, request, &response);
  }
};

TEST_F(PartialMatrixRequests, ThatEndedTheServerAreRefusedByEveryCall) {
  start();
  for (const auto& [request, field] : found()) {
    const grpc::Status solved = unary(request), coupled = streamed(request), kept = submitted(request);
    for (const grpc::Status* status : {&solved, &coupled, &kept})
      EXPECT_EQ(status->error_code(), grpc::StatusCode::INVALID_ARGUMENT) << status->error_message();
    EXPECT_EQ(bad_field(solved).field(), field);
    EXPECT_EQ(bad_field(coupled).field(), "solve." + std::string(field));
    EXPECT_EQ(bad_field(kept).field(), field);
    BatchCall batch([this](grpc::ClientContext* context) { return solver().SolveBatch(context); });
    v1::SolveBatchRequest one;
    *one.mutable_solve() = request;
    batch.write(one);
    batch.done();
    const auto answer = batch.next();
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->error().code(), grpc::StatusCode::INVALID_ARGUMENT) << answer->DebugString();
    EXPECT_TRUE(batch.finish().ok());
  }
  const auto posted =
      post(R"({"coupled":{"blocks":[{"problem":{"gradient":[1,1]},"coupling":{"columns":1000}}]}})");
  EXPECT_EQ(posted->status, 400) << posted->body;
  EXPECT_EQ(error_of(posted)["field"], "coupled.blocks[0].coupling.columns") << posted->body;
  EXPECT_TRUE(lives());
}

// Every partial form in every matrix of every kind of request.
TEST_F(PartialMatrixRequests, OfEveryFormAndPlaceNameTheirMatrix) {
  start();
  using Part = v1::SparseMatrix* (v1::Problem::*)();
  const std::pair<const char*, Part> parts[] = {
      {"hessian", &v1::Problem::mutable_hessian},
      {"equality_matrix", &v1::Problem::mutable_equality_matrix},
      {"inequality_matrix", &v1::Problem::mutable_inequality_matrix},
      {"left_matrix", &v1::Problem::mutable_left_matrix},
      {"right_matrix", &v1::Problem::mutable_right_matrix},
  };
  const auto small = [](v1::Problem* problem) {
    for (int j = 0; j < 4; ++j) problem->add_gradient(1.0);
  };
  const auto spoil = [](const PartialMatrix& form, v1::SparseMatrix* into) {
    SparseMatrix m;
    form.make(m, 4);
    into->set_rows(m.rows), into->set_columns(m.columns);
    into->mutable_column_pointers()->Assign(m.column_pointers.begin(), m.column_pointers.end());
    into->mutable_row_indices()->Assign(m.row_indices.begin(), m.row_indices.end());
    into->mutable_values()->Assign(m.values.begin(), m.values.end());
  };
  const auto expect_refused = [&](const v1::SolveRequest& request, const std::string& matrix,
                                  const std::string& what) {
    const grpc::Status status = unary(request);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << what << status.error_message();
    EXPECT_TRUE(bad_field(status).field().starts_with(matrix + "."))
        << what << ": " << bad_field(status).field() << " is not of " << matrix;
  };
  for (const PartialMatrix& form : partial_matrices()) {
    for (const auto& [name, part] : parts) {
      v1::SolveRequest plain;
      small(plain.mutable_problem());
      spoil(form, (plain.mutable_problem()->*part)());
      const std::string field = std::string("problem.") + name, what = std::string(form.name) + " in " + name;
      expect_refused(plain, field, what);
      v1::SolveRequest segments = plain, scenarios = plain, derivatives = plain, coupled;
      for (int j = 0; j < 4; ++j) segments.mutable_coupled()->mutable_segments()->add_stages(j);
      segments.mutable_coupled()->mutable_segments()->set_num_segments(2);
      expect_refused(segments, field, what + ", segments");
      scenarios.mutable_scenarios()->add_first_stage(0);
      expect_refused(scenarios, field, what + ", scenarios");
      derivatives.mutable_sensitivity();
      expect_refused(derivatives, field, what + ", derivatives");
      small(coupled.mutable_coupled()->add_blocks()->mutable_problem());
      *coupled.mutable_coupled()->add_blocks()->mutable_problem() = plain.problem();
      expect_refused(coupled, "coupled.blocks[1]." + field, what + ", coupled");
    }
    v1::SolveRequest coupling;
    small(coupling.mutable_coupled()->add_blocks()->mutable_problem());
    spoil(form, coupling.mutable_coupled()->mutable_blocks(0)->mutable_coupling());
    expect_refused(coupling, "coupled.blocks[0].coupling", form.name);
    coupling.mutable_coupled()->add_coupling_rhs(0.0);
    expect_refused(coupling, "coupled.blocks[0].coupling", std::string(form.name) + ", one row");
  }
  EXPECT_TRUE(lives());
}

// A client with one session took all memory of the server. An update of 67 MB, two bytes for each of 33
// million empty blocks of a shift, became 1.8 GB before anything looked at it; with latest_only the blocks of
// overtaken updates piled up in the one that waited (25 MB sent: 600 MB, copied again at each); and 64
// updates waited in each session outside every limit (queue_bytes 20 MB: 1022 MB resident).
//
// Updates were parsed whatever their size, blocks had no bound, what is taken along was appended, and only
// the update that ran was counted.
using Call = Bidi<v1::SessionRequest, v1::SessionResponse>;

class SessionMemory : public ServiceTest {
 protected:
  /// A session that is ready, of the problem min z'z - z'1 with n variables.
  std::unique_ptr<Call> set_up(int n, bool latest_only = false) {
    OwnedProblem problem;
    problem.Q = {n, n, {}, {}, std::vector<double>(static_cast<std::size_t>(n), 2.0)};
    for (Index i = 0; i < n; ++i) problem.Q.row_indices.push_back(i);
    for (Index i = 0; i <= n; ++i) problem.Q.column_pointers.push_back(i);
    problem.g.assign(static_cast<std::size_t>(n), -1.0);
    v1::SessionRequest request;
    to_message(problem.view(), request.mutable_setup()->mutable_problem());
    request.mutable_setup()->set_latest_only(latest_only);
    auto call =
        std::make_unique<Call>([this](grpc::ClientContext* context) { return solver().Session(context); });
    EXPECT_TRUE(call->write(request));
    const auto ready = call->next();
    EXPECT_TRUE(ready && ready->has_ready());
    return call;
  }
  static Expected<void> check(const std::string& message, const google::protobuf::Descriptor& type) {
    google::protobuf::io::ArrayInputStream bytes(message.data(), static_cast<int>(message.size()));
    return check_fields(bytes, type, server::kMostFields);
  }
  static v1::SessionRequest update(std::int64_t sequence, int numbers = 0) {
    v1::SessionRequest request;
    request.mutable_update()->set_sequence(sequence);
    for (int i = 0; i < numbers; ++i) request.mutable_update()->mutable_problem()->add_gradient(-1.0);
    return request;
  }
};

TEST_F(SessionMemory, AnUpdateLargerThanItsProblemIsRefusedBeforeItIsParsed) {
  start({"--sensitivity-bytes", "0"});  // which an update may have beyond its problem
  const auto call = set_up(2);
  v1::SessionRequest bomb = update(1);
  for (int i = 0; i < 1'000'000; ++i) bomb.mutable_update()->mutable_shift()->add_variables();
  call->write(bomb);
  const grpc::Status status = call->finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bad_field(status).field(), "update");
  EXPECT_NE(status.error_message().find("must have at most"), std::string::npos) << status.error_message();
  EXPECT_TRUE(lives());
}

// The same for a problem so large that the size alone would let them pass.
TEST_F(SessionMemory, BlocksOfAShiftAreCountedBeforeTheyAreMade) {
  const PartSizes sizes{.g = 1000, .Q = 1'000'000};
  v1::SessionRequest bomb = update(1);
  for (int i = 0; i < 100'000; ++i) bomb.mutable_update()->mutable_shift()->add_variables();
  grpc::ByteBuffer bytes = server::serialize(bomb);
  v1::SessionRequest parsed;
  const auto refused = server::parse_update(bytes, sizes, &parsed);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().field, "update.shift.variables[4997]") << refused.error().bound;
  EXPECT_EQ(parsed.ByteSizeLong(), 0U) << "nothing was made of it";
}

// Two bytes a field that nobody knows became sixteen and more, in every request.
TEST_F(SessionMemory, FieldsThatAreNotKnownAreCountedToo) {
  start();
  std::string bytes;
  for (int i = 0; i < 100'000; ++i) bytes += std::string("\x98\x06\x00", 3);  // field 99: 0
  const RawAnswer answer = raw_call(channel(), "/marble.v1.Solver/Solve", bytes);
  EXPECT_EQ(answer.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bad_field(answer.status).field(), "99[1000]") << answer.status.error_message();
}

// So did numbers of an array that have another type on the wire than the array's, which nobody counted.
TEST_F(SessionMemory, NumbersOfAnotherTypeThanTheirArrayAreCounted) {
  const google::protobuf::Descriptor& type = *v1::Problem::descriptor();
  const auto number = static_cast<char>(type.FindFieldByName("gradient")->number() << 3);
  std::string bytes;
  for (int i = 0; i < 5000; ++i) bytes += {number, 0};  // a varint, of doubles
  const auto refused = check(bytes, type);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().field, "gradient[1000]");
  v1::Problem honest;
  for (int i = 0; i < 5000; ++i) honest.add_gradient(1.0);
  EXPECT_TRUE(check(honest.SerializeAsString(), type).has_value());
}

TEST_F(SessionMemory, FieldsWithinGroupsAreCounted) {
  const google::protobuf::Descriptor& type = *v1::Problem::descriptor();
  std::string pairs, nested;
  for (int i = 0; i < 5000; ++i) pairs += "\x7b\x7c";  // field 15: a group, which ends
  for (int i = 0; i < 5000; ++i) nested += "\x7b";
  const std::string filled = "\x7b" + pairs;
  for (const std::string& bytes : {pairs, nested, filled}) {
    const auto refused = check(bytes, type);
    ASSERT_FALSE(refused.has_value());
    EXPECT_EQ(refused.error().field.substr(0, 3), "15[") << refused.error().field;
  }
}

TEST_F(SessionMemory, AShiftThatMovesMoreThanThereIsIsReportedWithItsBlock) {
  start();
  const auto call = set_up(4);
  v1::SessionRequest twice = update(1);
  for (int i = 0; i < 2; ++i) {
    v1::ShiftBlock* block = twice.mutable_update()->mutable_shift()->add_variables();
    block->set_count(4);
    block->set_by(1);
  }
  call->write(twice);
  const auto reported = call->next();
  ASSERT_TRUE(reported && reported->has_error());
  EXPECT_NE(reported->error().status().message().find("update.shift.variables[1] = 6: "), std::string::npos)
      << reported->error().status().message();
  call->write(update(2));
  EXPECT_TRUE(call->next()->has_answer()) << "the session goes on";
}

TEST_F(SessionMemory, UpdatesThatWaitAreCountedAndWaitElsewhereBeyondTheLimit) {
  constexpr int kNumbers = 20'000, kUpdates = 40;
  constexpr std::int64_t kLimit = 4'000'000;
  start({"--workers", "1", "--queue-bytes", std::to_string(kLimit)});
  const auto call = set_up(kNumbers);
  v1::SolveRequest blocking = long_request();
  blocking.set_priority(v1::PRIORITY_REALTIME);  // it steps aside for no session
  Stream blocker(solver(), blocking);
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  const std::int64_t before = counters().request_bytes();
  std::thread writer([&] {
    for (int i = 1; i <= kUpdates; ++i) EXPECT_TRUE(call->write(update(i, kNumbers)));
    call->done();
  });
  const std::int64_t one = 8 * kNumbers;
  EXPECT_TRUE(eventually([&] { return counters().request_bytes() >= before + 6 * one; }))
      << "GetInfo counts them";
  EXPECT_LE(counters().request_bytes(), before + kLimit / 4 + 2 * one)
      << "a quarter waits, one stands in the queue";
  blocker.cancel();
  for (int i = 1; i <= kUpdates; ++i) {
    const auto answer = call->next();
    ASSERT_TRUE(answer && answer->has_answer()) << "none is lost: " << i;
    EXPECT_EQ(answer->answer().sequence(), i);
  }
  writer.join();
  EXPECT_TRUE(call->finish().ok());
  EXPECT_TRUE(eventually([&] { return counters().request_bytes() == 0; }));
}

TEST_F(SessionMemory, ASessionCountsTheUpdatesItHasRoomFor) {
  start();
  const auto call = set_up(1000);
  EXPECT_GE(counters().session_bytes(), 2 * server::most_update_bytes({.g = 1000, .Q = 1000}));
}

// Answers that nobody read were kept, 64 a session, and as long as its client answered pings.
TEST_F(SessionMemory, AClientThatReadsNoAnswerLosesItsSession) {
  start({"--session-idle-s", "0.5"});
  constexpr int kNumbers = 100'000;
  const auto call = set_up(kNumbers);
  std::thread writer([&] {
    for (int i = 1; i <= 20 && call->write(update(i)); ++i) {
    }
  });
  EXPECT_TRUE(eventually([&] { return counters().sessions() == 0; }));
  EXPECT_EQ(counters().session_bytes(), 0);
  EXPECT_LT(counters().updates_total(), 20) << "solved for nobody";
  call->cancel();
  writer.join();
}

}  // namespace
}  // namespace marble::testing
