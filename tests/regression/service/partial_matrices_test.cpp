// Symptom: a request of 20 bytes ended the server (SIGSEGV), at every start again where its job was kept.
// Cause: matrices without rows, columns and arrays are empty; one without rows, but with columns or with
// entries, passed for empty too, and the work of coupled problems read, or wrote, where its columns said.
#include <string>
#include <utility>
#include <vector>

#include "service/bidi.h"
#include "service/http_service_test.h"
#include "support/partial_matrix.h"

namespace marble::testing {
namespace {

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

}  // namespace
}  // namespace marble::testing
