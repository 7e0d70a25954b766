// marble replay: a bundle is solved again to the same bits, and what differs is reported.
#include "replay_test.h"

#include <cmath>

#include "marble/client.h"
#include "marble/convert.h"
#include "support/coupled_problems.h"
#include "support/random_problem.h"

namespace marble::testing {
namespace {

v1::SolveRequest request_of_random(std::uint64_t seed) {
  RandomSizes sizes;
  sizes.variables = static_cast<Index>(8 + seed % 7);
  sizes.pairs = static_cast<Index>(2 + seed % 5);
  sizes.indefinite = seed % 3 == 0;
  v1::SolveRequest request;
  to_message(random_problem(sizes, seed).view(), request.mutable_problem());
  if (seed % 2 == 0) request.mutable_options()->set_num_starts(3);
  if (seed % 5 == 0) request.mutable_options()->set_path(v1::PATH_PAPER);
  if (seed % 7 == 0) request.mutable_options()->set_global_search(true);
  return request;
}

TEST_F(Replay, TwentyRandomJobsAreSolvedAgainToTheSameBits) {
  Node node({"--workers", "2"});
  std::vector<std::string> ids;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) ids.push_back(node.submit(request_of_random(seed)));
  for (std::size_t i = 0; i < ids.size(); ++i) {
    finish(node, ids[i]);
    expect_same(bundle_of(node, ids[i]), "seed " + std::to_string(i + 1));
  }
}

TEST_F(Replay, WhateverIsAskedForIsAskedForAgain) {
  Node node({});
  const auto submitted = [&](const v1::SolveRequest& request) {
    const std::string id = node.submit(request);
    finish(node, id);
    return bundle_of(node, id);
  };
  v1::SolveRequest request = request_of_random(4);
  const std::string cold = submitted(request);
  v1::SolveResponse answer;
  ASSERT_TRUE(answer.ParseFromString(read(cold).answer));
  to_message(solution_of(answer.solution()), request.mutable_warm_start());
  expect_same(submitted(request), "warm start");
  request.clear_warm_start();
  *request.mutable_initial_point()->mutable_z() = answer.solution().z();
  expect_same(submitted(request), "initial point");

  const auto client = Client::connect(node.server().address());
  ASSERT_TRUE(client);
  const OwnedCoupled cell = random_coupled({}, 3);
  const auto coupled = client->jobs().submit(cell.view());
  ASSERT_TRUE(coupled) << coupled.error().message();
  finish(node, coupled->job_id);
  expect_same(bundle_of(node, coupled->job_id), "coupled");

  const OwnedProblem shop = random_problem({}, 8);
  ScenarioProblem scenarios{.base = shop.view(), .first_stage = {0, 1}, .scenarios = 6};
  scenarios.sample = [&shop](std::int64_t i) -> Expected<ScenarioNumbers> {
    ScenarioNumbers numbers{.g = shop.g};
    numbers.g[3] += 0.1 * static_cast<double>(i);
    return numbers;
  };
  const auto plan = client->jobs().submit(scenarios, {.max_sample_size = 4, .out_of_sample_scenarios = 2});
  ASSERT_TRUE(plan) << plan.error().message();
  finish(node, plan->job_id);
  expect_same(bundle_of(node, plan->job_id), "scenarios");
}

TEST_F(Replay, RefusesAMatrixThatIsNeitherEmptyNorComplete) {
  v1::SolveRequest request;
  v1::CoupledBlock* block = request.mutable_coupled()->add_blocks();
  block->mutable_problem()->add_gradient(1.0);
  block->mutable_coupling()->set_columns(9);
  Bundle bundle;
  report_build(&bundle.facts);
  bundle.request = request.SerializeAsString();
  bundle.facts.set_request_bytes(static_cast<std::int64_t>(bundle.request.size()));
  const Result refused = replay(write(bundle));
  EXPECT_EQ(refused.exit_code, 2) << refused.out;
  EXPECT_NE(refused.err.find("coupling.columns"), std::string::npos) << refused.err;
}

TEST_F(Replay, AServerSolvesItAgainToo) {
  Node node({});
  const std::string id = node.submit(request_of_random(2));
  finish(node, id);
  const std::string path = bundle_of(node, id);
  const Result there = replay(path, "--server " + node.server().address());
  EXPECT_EQ(there.exit_code, 0) << there.out << there.err;
  EXPECT_NE(there.out.find("same         bit for bit"), std::string::npos) << there.out;
  EXPECT_EQ(replay(path, "--server 127.0.0.1:1").exit_code, 3);
}

TEST_F(Replay, AnySolveMakesABundleHereOrByAServer) {
  const std::string problem = quoted(file("good.json", kGood));
  Node node({});
  for (const std::string& where : {std::string("--local"), "--server " + node.server().address()}) {
    const std::string path = bundle_path();
    const Result solved = run("solve --quiet " + where + " --bundle " + quoted(path) + " " + problem);
    EXPECT_EQ(solved.exit_code, 0) << solved.err;
    expect_same(path, where);
  }
  const Result two = run("solve --local --bundle x.tar.zst " + problem + " " + problem);
  EXPECT_EQ(two.exit_code, 2);
  EXPECT_NE(two.err.find("must go with one FILE, not 2"), std::string::npos) << two.err;
}

TEST_F(Replay, ItsProblemIsAProblemFile) {
  const std::string path = bundle_path();
  ASSERT_EQ(run("solve --local --quiet --bundle " + quoted(path) + " " + quoted(file("good.json", kGood)))
                .exit_code,
            0);
  std::string problem, trace, answer;
  const auto take = [&](std::string_view name, std::string content) {
    if (name == "problem.json") problem = content;
    if (name == "trace.csv") trace = content;
    if (name == "answer.json") answer = content;
  };
  ASSERT_TRUE(read_parts(read_file(path), take));
  const Result again = run("solve --local --output json --quiet " + quoted(file("problem.json", problem)));
  EXPECT_EQ(again.exit_code, 0) << again.err << problem;
  EXPECT_EQ(again.lines().at(0)["objective"], Json::parse(answer)["solution"]["objective"]);
  EXPECT_EQ(run("plot " + quoted(file("trace.csv", trace))).exit_code, 0) << trace;
}

TEST_F(Replay, TheFirstDifferenceIsReportedWithBothNumbers) {
  const std::string path = bundle_path();
  ASSERT_EQ(run("solve --local --quiet --bundle " + quoted(path) + " " + quoted(file("good.json", kGood)))
                .exit_code,
            0);
  Bundle bundle = read(path);
  v1::SolveResponse answer;
  ASSERT_TRUE(answer.ParseFromString(bundle.answer));
  const double z = answer.solution().z(1);
  answer.mutable_solution()->set_z(1, std::nextafter(z, 2.0));
  answer.mutable_solution()->set_iterations(99);
  bundle.answer = answer.SerializeAsString();
  bundle.facts.set_answer_bytes(static_cast<std::int64_t>(bundle.answer.size()));
  Result reported = replay(write(bundle), "--output json");
  EXPECT_EQ(reported.exit_code, 1) << reported.err;
  Json json = reported.lines().at(0);
  EXPECT_EQ(json["same"], false);
  EXPECT_EQ(json["differences"].size(), 2U) << json;
  EXPECT_EQ(json["first"]["field"], "z");
  EXPECT_EQ(json["first"]["index"], 1);
  EXPECT_EQ(std::stod(json["first"]["now"].get<std::string>()), z);
  EXPECT_EQ(std::stod(json["first"]["then"].get<std::string>()), std::nextafter(z, 2.0));

  v1::Progress* row = bundle.facts.mutable_job()->mutable_trace()->mutable_rows(2);
  row->set_kappa(row->kappa() * 2.0);
  reported = replay(write(bundle), "--output json");
  EXPECT_EQ(reported.lines().at(0)["first"]["field"], "trace.kappa")
      << "an iteration comes before the answer";
  EXPECT_EQ(reported.lines().at(0)["first"]["index"], 2);
  const Result text = replay(write(bundle));
  EXPECT_EQ(text.exit_code, 1);
  EXPECT_NE(text.out.find("first        trace.kappa[2] was "), std::string::npos) << text.out;

  bundle.facts.mutable_job()->mutable_trace()->mutable_rows()->RemoveLast();
  EXPECT_NE(replay(write(bundle)).out.find("differs      trace was "), std::string::npos)
      << "a row is missing";
}

TEST_F(Replay, OfASolveThatWasCutOffTheIterationsAreCompared) {
  Node node({"--workers", "1", "--trace-rows", "16"});
  const std::string id = node.submit(long_request());
  ASSERT_TRUE(eventually([&] { return node.job(id).iterations() > 40; }));
  const Bundle running = read(bundle_of(node, id));
  EXPECT_TRUE(running.answer.empty());
  EXPECT_EQ(running.facts.job().job().state(), v1::JOB_STATE_RUNNING);
  EXPECT_GT(running.facts.job().trace().rows_size(), 2);
  ASSERT_TRUE(node.cancel(id).ok());
  finish(node, id);
  Bundle ended = read(bundle_of(node, id));
  EXPECT_GT(ended.facts.job().trace().stride(), 1) << "thinned";
  v1::GetJobResponse* job = ended.facts.mutable_job();
  const auto last = job->trace().rows().rbegin()->iteration();
  job->mutable_options()->set_max_iterations(last + 20);
  const Result reported = replay(write(ended), "--output json");
  EXPECT_EQ(reported.exit_code, 0) << reported.out << reported.err;
  EXPECT_EQ(reported.lines().at(0)["not_compared"].size(), 1U) << reported.out;
}

TEST_F(Replay, AJobThatFailedIsComparedByItsError) {
  Node node({"--solve-bytes", "1048576"});
  v1::SolveRequest request;
  to_message(filling_problem(1500).view(), request.mutable_problem());
  const std::string id = node.submit(request);
  v1::SolveResponse response;
  EXPECT_EQ(node.result(id, true, &response).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  const std::string path = bundle_of(node, id);
  EXPECT_EQ(replay(path, "--server " + node.server().address()).exit_code, 0) << "refused again";
  const Result here = replay(path, "--output json");
  EXPECT_EQ(here.exit_code, 1) << here.err;
  EXPECT_EQ(here.lines().at(0)["first"]["field"], "error");
  EXPECT_EQ(here.lines().at(0)["first"]["now"], "an answer");
}

TEST_F(Replay, RefusesAFewKilobytesOfNestedFieldsByNameInHalfAGigabyte) {
  std::string blocks("\x4a\x80\x87\xa7\x0e", 5);  // coupled, of 30 million bytes
  for (int i = 0; i < 15'000'000; ++i) blocks += std::string_view("\x0a\0", 2);
  Bundle bundle;
  bundle.facts.set_request_bytes(static_cast<std::int64_t>(blocks.size()));
  std::string packed;
  TarZstWriter writer([&](std::string_view bytes) -> Expected<void> {
    packed += bytes;
    return {};
  });
  const std::string facts = bundle.facts.SerializeAsString();
  for (const auto& [name, content] :
       {std::pair("job.pb", &std::as_const(facts)), std::pair("request.pb", &std::as_const(blocks))}) {
    EXPECT_TRUE(writer.add(name, content->size(), 0,
                           [&, all = content](const TarZstWriter::Report& report) { return report(*all); }));
  }
  EXPECT_TRUE(writer.finish());
  EXPECT_LT(packed.size(), 10'000U);
  const std::string path = file("small.tar.zst", packed), err = directory_.file("limited");
  ChildProcess limited({"/bin/sh", "-c",
                        std::string("ulimit -v 524288; exec '") + MARBLE_BINARY + "' replay '" + path +
                            "' >'" + err + "' 2>&1"},
                       directory_.file("shell"));
  EXPECT_EQ(limited.wait(), 2);
  const std::string said = read_file(err);
  EXPECT_NE(said.find("small.tar.zst: is no bundle: request.pb: coupled.blocks["), std::string::npos) << said;
  EXPECT_NE(said.find("fields"), std::string::npos) << said;
}

TEST_F(Replay, WhatIsNoBundleIsReportedAsSuch) {
  const Result missing = replay("nowhere.tar.zst");
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_NE(missing.err.find("nowhere.tar.zst"), std::string::npos) << missing.err;
  const Result problem = replay(file("good.json", kGood), "--output json");
  EXPECT_EQ(problem.exit_code, 2);
  EXPECT_NE(problem.err.find("is no bundle"), std::string::npos) << problem.err;
  EXPECT_EQ(problem.lines().at(0)["error"]["code"], "invalid_argument");
}

}  // namespace
}  // namespace marble::testing
