// Jobs.SubmitArray and Jobs.ArrayResults: many problems as one job.
#include <gmock/gmock.h>

#include <limits>
#include <set>
#include <thread>

#include "array_client.h"
#include "jobs_client.h"

namespace marble::testing {
namespace {

using ::testing::HasSubstr;

class Array : public JobsServiceTest {
 protected:
  [[nodiscard]] v1::ArrayProgress progress(const std::string& id) { return get(id).job().array(); }
  [[nodiscard]] bool eventually_finished(const std::string& id) {
    return eventually([&] { return get(id).job().state() == v1::JOB_STATE_FINISHED; });
  }
  static v1::ArraySetup base() {
    v1::ArraySetup setup;
    *setup.mutable_problem() = example_request().problem();
    return setup;
  }
  /// Why these messages are refused.
  grpc::Status refused(const v1::ArraySetup& setup, const std::vector<v1::ArrayElement>& elements) {
    std::string id;
    grpc::Status status = submit_array(jobs(), setup, elements, &id);
    EXPECT_TRUE(lives());
    EXPECT_TRUE(eventually([&] { return counters().request_bytes() == 0; })) << "nothing of it stays";
    return status;
  }
};

TEST_F(Array, EveryElementIsAnsweredOnceWhileItStreams) {
  start({"--workers", "2"});
  constexpr int kElements = 3000;
  const std::string id = submit_array(jobs(), elements_of(kElements));
  ArrayReader reader(jobs(), id);
  expect_numbered(reader.drain(), kElements);
  EXPECT_TRUE(reader.finish().ok());
  ASSERT_TRUE(eventually_finished(id));
  const v1::JobInfo job = get(id).job();
  EXPECT_EQ(job.kind(), v1::JOB_KIND_ARRAY);
  EXPECT_EQ(job.priority(), v1::PRIORITY_BATCH);
  EXPECT_FALSE(job.has_error());
  EXPECT_EQ(job.array().elements(), kElements);
  EXPECT_EQ(job.array().done(), kElements);
  EXPECT_EQ(job.array().solved(), kElements);
  EXPECT_EQ(job.array().failed(), 0);
  EXPECT_GT(job.iterations(), kElements);
  EXPECT_EQ(counters().request_bytes(), 0);
}

TEST_F(Array, OneWorkerAnswersElementsInTheirOrder) {
  start({"--workers", "1"});
  for (int k = 0; k < 200; ++k) {
    ArrayReader reader(jobs(), submit_array(jobs(), elements_of(6)));
    std::vector<std::int64_t> order;
    for (const v1::ArrayResultsResponse& answer : reader.drain()) order.push_back(answer.index());
    ASSERT_THAT(order, ::testing::ElementsAre(0, 1, 2, 3, 4, 5)) << "array " << k;
  }
}

TEST_F(Array, NewNumbersForTheBaseAnswerAsTheWholeProblems) {
  start({"--workers", "1"});
  v1::ArraySetup setup = base();
  setup.mutable_problem()->set_name("gait");
  v1::Problem whole = setup.problem();
  v1::ArrayElement element;
  v1::ProblemUpdate& update = *element.mutable_update();
  double number = 1.0;
  for (double& value : *whole.mutable_hessian()->mutable_values()) {
    if (value != 0.0) value += number;
    update.add_hessian_values(value);
  }
  for (double& value : *whole.mutable_gradient()) {
    value = 0.25 * ++number;
    update.add_gradient(value);
  }
  for (double& value : *whole.mutable_equality_matrix()->mutable_values()) {
    value = 2.0;
    update.add_equality_values(value);
  }
  whole.set_constant(7.0);
  update.set_constant(7.0);
  v1::SolveRequest request;
  *request.mutable_problem() = whole;
  v1::SolveResponse expected;
  ASSERT_TRUE(solve(request, &expected).ok());
  ArrayReader reader(jobs(),
                     submit_array(jobs(), {element, v1::ArrayElement(), numbers_of_element(3)}, setup));
  std::map<std::int64_t, v1::Solution> solutions;
  for (const v1::ArrayResultsResponse& answer : reader.drain()) {
    ASSERT_TRUE(answer.has_result()) << answer.error().message();
    solutions[answer.index()] = answer.result().solution();
  }
  ASSERT_EQ(solutions.size(), 3U);
  EXPECT_EQ(solutions[0].objective(), expected.solution().objective());
  EXPECT_THAT(solutions[0].z(), ::testing::ElementsAreArray(expected.solution().z()));
  EXPECT_NEAR(solutions[1].objective(), 3.0, 1e-9) << "the base itself";
  EXPECT_NEAR(solutions[2].z(0), 3.0, 1e-6);
}

TEST_F(Array, OptionsOfTheArrayHoldUnlessAnElementHasItsOwn) {
  start();
  v1::ArraySetup setup = base();
  setup.mutable_options()->set_max_iterations(1);
  v1::ArrayElement own = numbers_of_element(1);
  own.mutable_solve()->mutable_options()->set_max_iterations(500);
  ArrayReader reader(jobs(), submit_array(jobs(), {numbers_of_element(0), own}, setup));
  for (const v1::ArrayResultsResponse& answer : reader.drain()) {
    ASSERT_TRUE(answer.has_result()) << answer.error().message();
    EXPECT_EQ(answer.result().solution().options().max_iterations(), answer.index() == 0 ? 1 : 500);
  }
}

TEST_F(Array, AStreamThatBrokeIsTakenUpAfterTheLastAnswerReceived) {
  start({"--workers", "2"});
  constexpr int kElements = 500;
  const std::string id = submit_array(jobs(), elements_of(kElements));
  std::vector<v1::ArrayResultsResponse> received;
  while (received.size() < kElements) {
    ArrayReader reader(jobs(), id, received.empty() ? 0 : received.back().sequence());
    for (int i = 0; i < 71; ++i) {
      auto answer = reader.next();
      if (!answer) break;
      received.push_back(std::move(*answer));
    }
  }
  expect_numbered(received, kElements);
  ArrayReader again(jobs(), id, kElements);
  EXPECT_TRUE(again.drain().empty());
  EXPECT_TRUE(again.finish().ok());
  ArrayReader too_far(jobs(), id, kElements + 1);
  const grpc::Status status = too_far.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bad_field(status).field(), "after");
}

TEST_F(Array, AnotherClientsJobsTakeTurns) {
  start({"--workers", "1", "--queue-jobs", "4", "--client-queued", "0"});
  v1::SolveRequest bounded = long_request(200);
  v1::ArrayElement slow;
  *slow.mutable_solve() = bounded;
  const std::string id = submit_array(jobs(), elements_of(1000, [&](std::int64_t) { return slow; }));
  ASSERT_TRUE(eventually([&] { return progress(id).done() > 0; }));
  EXPECT_LE(counters().queued(), 3) << "a few at a time";
  for (int i = 0; i < 3; ++i) {
    v1::SolveRequest patient = example_request();
    patient.set_priority(v1::PRIORITY_BATCH);
    v1::SolveResponse response;
    EXPECT_TRUE(solve(patient, &response).ok());
  }
  EXPECT_LT(progress(id).done(), 1000) << "they did not wait for all of it";
  EXPECT_TRUE(cancel(id).ok());
  EXPECT_TRUE(eventually_finished(id));
}

TEST_F(Array, IsOneJobOfTheQuotaAndItsBytesCount) {
  start({"--workers", "1", "--client-queued", "2", "--client-bytes", "2000000"});
  const std::string first = submit_array(jobs(), {long_element(), long_element(), long_element()});
  const std::string second = submit_array(jobs(), elements_of(50));
  std::string id;
  grpc::Status status = submit_array(jobs(), {}, elements_of(1), &id);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("client_queued"));
  EXPECT_TRUE(retry_info(status).has_value());
  EXPECT_GT(counters().request_bytes(), 10'000);
  EXPECT_TRUE(remove(second).ok());
  status = submit_array(jobs(), {}, elements_of(10000), &id);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("client_bytes"));
  EXPECT_TRUE(remove(first).ok());
  EXPECT_TRUE(eventually([&] { return counters().request_bytes() == 0; }));
  expect_numbered(ArrayReader(jobs(), submit_array(jobs(), elements_of(10))).drain(), 10);
}

TEST_F(Array, CancelledHalfWayReportsWhatThereIsAndThenWhy) {
  start({"--workers", "1"});
  std::vector<v1::ArrayElement> elements = elements_of(3);
  elements.push_back(long_element());
  for (std::int64_t index = 4; index < 10; ++index) elements.push_back(numbered_element(index));
  const std::string id = submit_array(jobs(), elements);
  ArrayReader reader(jobs(), id);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(reader.next().has_value());
  EXPECT_TRUE(cancel(id).ok());
  const std::vector<v1::ArrayResultsResponse> rest = reader.drain();
  const grpc::Status status = reader.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::CANCELLED) << status.error_message();
  for (const v1::ArrayResultsResponse& answer : rest)
    EXPECT_TRUE(answer.has_error() || answer.result().solution().status() == v1::STATUS_CANCELLED);
  ASSERT_TRUE(eventually_finished(id));
  const v1::JobInfo job = get(id).job();
  EXPECT_EQ(job.error().code(), static_cast<int>(grpc::StatusCode::CANCELLED));
  EXPECT_EQ(job.array().done(), static_cast<std::int64_t>(3 + rest.size()));
  ArrayReader again(jobs(), id);
  EXPECT_EQ(again.drain().size(), 3 + rest.size()) << "its answers are kept";
  EXPECT_EQ(again.finish().error_code(), grpc::StatusCode::CANCELLED);
}

TEST_F(Array, DeletedItIsGoneForWhoReadsIt) {
  start({"--workers", "1"});
  const std::string id = submit_array(jobs(), {numbered_element(0), long_element()});
  ArrayReader reader(jobs(), id);
  EXPECT_TRUE(reader.next().has_value());
  EXPECT_TRUE(remove(id).ok());
  (void)reader.drain();
  EXPECT_EQ(reader.finish().error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(ArrayReader(jobs(), id).finish().error_code(), grpc::StatusCode::NOT_FOUND);
  get(id, grpc::StatusCode::NOT_FOUND);
  EXPECT_TRUE(eventually_idle());
}

TEST_F(Array, TheSameArraySentAgainIsTheSameJob) {
  start();
  v1::ArraySetup setup;
  setup.set_request_id("night run");
  const std::string id = submit_array(jobs(), elements_of(20), setup);
  EXPECT_EQ(submit_array(jobs(), elements_of(20), setup), id);
  EXPECT_TRUE(eventually_finished(id));
  EXPECT_EQ(submit_array(jobs(), elements_of(20), setup), id);
  const grpc::Status status = refused(setup, elements_of(19));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bad_field(status).field(), "request_id");
  v1::SolveRequest alone = example_request();
  alone.set_request_id("night run");
  std::string other;
  EXPECT_EQ(submit(alone, &other).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_TRUE(remove(id).ok());
  EXPECT_NE(submit_array(jobs(), elements_of(20), setup), id);
}

TEST_F(Array, WhatIsWrongIsReportedWithItsElement) {
  start();
  v1::ArrayElement nan = numbers_of_element(0);
  nan.mutable_update()->set_equality_offset(0, std::numeric_limits<double>::quiet_NaN());
  grpc::Status status = refused(base(), {numbers_of_element(0), nan});
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bad_field(status).field(), "elements[1].update.equality_offset[0]") << status.error_message();

  v1::ArrayElement infinite = numbered_element(1);
  infinite.mutable_solve()->mutable_problem()->set_gradient(2, std::numeric_limits<double>::infinity());
  EXPECT_EQ(bad_field(refused({}, {infinite})).field(), "elements[0].solve.problem.gradient[2]");

  v1::ArrayElement shape = numbers_of_element(1);
  shape.mutable_update()->add_equality_offset(1.0);
  EXPECT_EQ(bad_field(refused(base(), {shape})).field(), "elements[0].update.equality_offset");
  EXPECT_EQ(bad_field(refused({}, {numbers_of_element(1)})).field(), "elements[0].update") << "no base";
  v1::ArrayElement both = numbered_element(1);
  both.mutable_update()->add_equality_offset(1.0);
  EXPECT_EQ(bad_field(refused(base(), {both})).field(), "elements[0].update");
  EXPECT_EQ(bad_field(refused({}, {v1::ArrayElement()})).field(), "elements[0].solve.problem.gradient");
  v1::ArrayElement named = numbered_element(1);
  named.mutable_solve()->set_request_id("mine");
  EXPECT_EQ(bad_field(refused({}, {named})).field(), "elements[0].solve.request_id");
  v1::ArrayElement urgent = numbered_element(1);
  urgent.mutable_solve()->set_priority(v1::PRIORITY_REALTIME);
  EXPECT_EQ(bad_field(refused({}, {urgent})).field(), "elements[0].solve.priority");
  v1::ArrayElement option = numbered_element(1);
  option.mutable_solve()->mutable_options()->set_max_iterations(-1);
  EXPECT_EQ(bad_field(refused({}, {option})).field(), "elements[0].solve.options.max_iterations");

  v1::ArraySetup setup = base();
  setup.mutable_problem()->set_gradient(0, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(bad_field(refused(setup, {})).field(), "setup.problem.gradient[0]");
  setup = {};
  setup.set_name(std::string(300, 'x'));
  EXPECT_EQ(bad_field(refused(setup, {})).field(), "setup.name");
  EXPECT_EQ(bad_field(refused({}, {})).field(), "end.elements");
}

TEST_F(Array, TooManyElementsAreRefused) {
  start({"--array-elements", "10"});
  std::string id;
  const grpc::Status status = submit_array(jobs(), {}, elements_of(11), &id);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("array_elements"));
  expect_numbered(ArrayReader(jobs(), submit_array(jobs(), elements_of(10))).drain(), 10);
}

TEST_F(Array, NothingStaysOfOneWhoseEndDoesNotCome) {
  start({"--workers", "1", "--client-queued", "1"});
  {
    ArraySubmission given_up(jobs());
    EXPECT_TRUE(given_up.setup({}));
    for (std::int64_t i = 0; i < 5; ++i) EXPECT_TRUE(given_up.element(numbered_element(i)));
    EXPECT_TRUE(eventually([&] { return counters().request_bytes() > 0; }));
  }
  EXPECT_TRUE(eventually([&] { return counters().request_bytes() == 0; }));
  {
    ArraySubmission closed(jobs());
    EXPECT_TRUE(closed.setup({}));
    EXPECT_TRUE(closed.element(numbered_element(0)));
    EXPECT_EQ(bad_field(closed.finish()).field(), "end");
  }
  {
    ArraySubmission wrong(jobs());
    EXPECT_TRUE(wrong.setup({}));
    EXPECT_TRUE(wrong.element(numbered_element(0)));
    (void)wrong.end(2);
    EXPECT_EQ(bad_field(wrong.finish()).field(), "end.elements");
  }
  {
    ArraySubmission headless(jobs());
    (void)headless.element(numbered_element(0));
    EXPECT_EQ(bad_field(headless.finish()).field(), "setup");
  }
  {
    ArraySubmission twice(jobs());
    EXPECT_TRUE(twice.setup({}));
    (void)twice.setup({});
    EXPECT_EQ(bad_field(twice.finish()).field(), "request");
  }
  v1::ListJobsResponse list;
  grpc::ClientContext context;
  EXPECT_TRUE(jobs().List(&context, {}, &list).ok());
  EXPECT_EQ(list.jobs_size(), 0);
  expect_numbered(ArrayReader(jobs(), submit_array(jobs(), elements_of(10))).drain(), 10);
}

TEST_F(Array, AReaderThatStallsHoldsNothingUp) {
  start({"--workers", "2"});
  constexpr int kElements = 2000;
  const std::string id = submit_array(jobs(), elements_of(kElements));
  ArrayReader stalled(jobs(), id);
  ASSERT_TRUE(eventually_finished(id));
  ArrayReader other(jobs(), id);
  expect_numbered(other.drain(), kElements);
  expect_numbered(stalled.drain(), kElements);
}

TEST_F(Array, ReadersAreWatchers) {
  start({"--workers", "1", "--watchers", "1", "--client-watchers", "0"});
  const std::string id = submit_array(jobs(), {numbered_element(0), long_element()});
  {
    ArrayReader first(jobs(), id);
    EXPECT_TRUE(first.next().has_value());
    const grpc::Status status = ArrayReader(jobs(), id).finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_THAT(status.error_message(), HasSubstr("watchers"));
  }
  EXPECT_TRUE(eventually([&] { return ArrayReader(jobs(), id).next().has_value(); }));
  EXPECT_TRUE(cancel(id).ok());
}

TEST_F(Array, WhatFailsIsAnAnswerAndTheOthersGoOn) {
  start({"--workers", "1", "--solve-bytes", "1048576"});
  v1::ArrayElement large;
  v1::Problem& problem = *large.mutable_solve()->mutable_problem();
  constexpr int kSize = 1000;  // a dense Q that does not fit
  problem.set_hessian_form(v1::HESSIAN_FORM_UPPER_TRIANGLE);
  v1::SparseMatrix& hessian = *problem.mutable_hessian();
  hessian.set_rows(kSize);
  hessian.set_columns(kSize);
  hessian.add_column_pointers(0);
  for (int column = 0; column < kSize; ++column) {
    problem.add_gradient(1.0);
    for (int row = 0; row <= column; ++row) {
      hessian.add_row_indices(row);
      hessian.add_values(row == column ? kSize : 1.0);
    }
    hessian.add_column_pointers(hessian.values_size());
  }
  const std::string id = submit_array(jobs(), {numbered_element(0), large, numbered_element(2)});
  ArrayReader reader(jobs(), id);
  int failed = 0;
  for (const v1::ArrayResultsResponse& answer : reader.drain()) {
    if (answer.has_error()) ++failed;
    EXPECT_EQ(answer.has_error(), answer.index() == 1);
  }
  EXPECT_EQ(failed, 1);
  EXPECT_TRUE(reader.finish().ok());
  EXPECT_EQ(progress(id).failed(), 1);
  EXPECT_EQ(progress(id).solved(), 2);
}

TEST_F(Array, WithoutRoomForItsAnswersItEnds) {
  start({"--workers", "1", "--result-bytes", "20000"});
  const std::string id = submit_array(jobs(), elements_of(200));
  ArrayReader reader(jobs(), id);
  const std::size_t reported = reader.drain().size();
  const grpc::Status status = reader.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("result_bytes"));
  EXPECT_GT(reported, 2U);
  EXPECT_LT(reported, 200U);
  EXPECT_TRUE(lives());
}

TEST_F(Array, OneAnswerCannotBeAskedForAndAJobIsNoArray) {
  start({"--workers", "1"});
  const std::string id = submit_array(jobs(), {long_element()});
  v1::SolveResponse response;
  const grpc::Status status = result(id, true, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("ArrayResults"));
  EXPECT_EQ(ArrayReader(jobs(), submit(example_request())).finish().error_code(),
            grpc::StatusCode::NOT_FOUND);
  EXPECT_TRUE(cancel(id).ok());
}

TEST_F(Array, ADrainFinishesWhatRunsAndEndsTheStream) {
  start({"--workers", "1", "--drain-grace-s", "0"});
  std::vector<v1::ArrayElement> elements = elements_of(10);
  elements[1] = long_element();
  ArrayReader reader(jobs(), submit_array(jobs(), elements));
  EXPECT_TRUE(reader.next().has_value());
  ArraySubmission half(jobs());
  EXPECT_TRUE(half.setup({}));
  EXPECT_TRUE(half.element(numbered_element(0)));
  server().terminate();
  (void)reader.drain();
  EXPECT_FALSE(reader.finish().ok());
  EXPECT_EQ(half.finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Array, AnswersComeWhileOthersRun) {
  start({"--workers", "2"});
  const std::string id = submit_array(jobs(), {long_element(), numbered_element(1), numbered_element(2)});
  ArrayReader reader(jobs(), id);
  std::set<std::int64_t> seen;
  for (int i = 0; i < 2; ++i) {
    const auto answer = reader.next();
    ASSERT_TRUE(answer.has_value());
    seen.insert(answer->index());
  }
  EXPECT_EQ(seen, (std::set<std::int64_t>{1, 2}));
  EXPECT_EQ(get(id).job().state(), v1::JOB_STATE_RUNNING);
  EXPECT_TRUE(cancel(id).ok());
  EXPECT_TRUE(reader.next().has_value()) << "the best iterate of what ran";
}

}  // namespace
}  // namespace marble::testing
