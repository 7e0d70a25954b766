#include "replay_test.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <cmath>
#include <random>

#include "marble/client.h"
#include "marble/convert.h"
#include "support/coupled_problems.h"
#include "support/random_problem.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

// marble replay: a bundle is solved again to the same bits, and what differs is reported.
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

// Bundles as files: whole or refused as damaged, whatever the bytes.
std::string file_of(const std::function<void(TarZstWriter&)>& fill) {
  std::string file;
  TarZstWriter writer([&](std::string_view bytes) -> Expected<void> {
    file += bytes;
    return {};
  });
  fill(writer);
  EXPECT_TRUE(writer.finish());
  return file;
}

void add(TarZstWriter& writer, const std::string& name, const std::string& content) {
  EXPECT_TRUE(writer.add(name, content.size(), 0,
                         [&](const TarZstWriter::Report& report) { return report(content); }));
}

Bundle small_bundle() {
  Bundle bundle;
  report_build(&bundle.facts);
  bundle.request = example_request().SerializeAsString();
  bundle.facts.set_request_bytes(static_cast<std::int64_t>(bundle.request.size()));
  return bundle;
}

std::string written(const Bundle& bundle) {
  std::string file;
  EXPECT_TRUE(write_bundle(bundle, [&](std::string_view bytes) -> Expected<void> {
    file += bytes;
    return {};
  }));
  return file;
}

void expect_refused(const std::string& file, const std::string& why) {
  const auto read = read_bundle(file);
  ASSERT_FALSE(read) << why;
  EXPECT_EQ(read.error().code, ErrorCode::invalid_argument);
  EXPECT_NE(read.error().message().find(why), std::string::npos) << read.error().message();
}

TEST(Bundles, ComeBackAsTheyWereWritten) {
  const Bundle bundle = small_bundle();
  const auto read = read_bundle(written(bundle));
  ASSERT_TRUE(read) << read.error().message();
  EXPECT_EQ(read->facts.SerializeAsString(), bundle.facts.SerializeAsString());
  EXPECT_EQ(read->request, bundle.request);
  EXPECT_TRUE(read->answer.empty());
}

TEST(Bundles, LoseNothingButTheRequestId) {
  v1::SolveRequest request = example_request();
  request.set_request_id("mine");
  request.set_priority(v1::PRIORITY_BATCH);
  std::string bytes = request.SerializeAsString();
  make_anonymous(&bytes);
  request.clear_request_id();
  EXPECT_EQ(bytes, request.SerializeAsString());
  make_anonymous(&bytes);
  EXPECT_EQ(bytes, request.SerializeAsString());
  std::string broken = "\x22\xff";
  make_anonymous(&broken);
  EXPECT_EQ(broken, "\x22\xff");
}

TEST(Bundles, CutOffOrDamagedAnywhereAreReportedToBe) {
  const std::string file = written(small_bundle());
  expect_refused("", "cut off");
  expect_refused("anything else, as long as it is no zstd", "no bundle");
  for (std::size_t size = 1; size < file.size(); size += 7) expect_refused(file.substr(0, size), "no bundle");
  std::mt19937 random(1);
  for (int i = 0; i < 300; ++i) {
    std::string damaged = file;
    damaged[random() % damaged.size()] ^= static_cast<char>(1 << random() % 8);
    const auto read = read_bundle(damaged);  // a bit that zstd does not use may be turned
    EXPECT_TRUE(!read || read->request == small_bundle().request);
  }
}

TEST(Bundles, MayNotUnpackToAnythingThatIsOutOfProportion) {
  const std::string zeros(1 << 20, '\0');
  const std::uint64_t megabytes = 600;
  const std::string bomb = file_of([&](TarZstWriter& writer) {
    EXPECT_TRUE(writer.add("README.txt", megabytes << 20, 0,
                           [&](const TarZstWriter::Report& report) -> Expected<void> {
                             for (std::uint64_t i = 0; i < megabytes; ++i) {
                               MARBLE_RETURN_IF_ERROR(report(zeros));
                             }
                             return {};
                           }));
  });
  EXPECT_LT(bomb.size(), 200'000U);
  expect_refused(bomb, "would unpack to more than");
}

// A message of a field of this number, which holds so many empty messages of number 1.
std::string empty_messages(int field, std::size_t count) {
  std::string inner, bytes;
  for (std::size_t i = 0; i < count; ++i) inner += std::string("\x0a\0", 2);
  google::protobuf::io::StringOutputStream stream(&bytes);
  google::protobuf::io::CodedOutputStream out(&stream);
  out.WriteTag(static_cast<std::uint32_t>(field << 3 | 2));
  out.WriteVarint32(static_cast<std::uint32_t>(inner.size()));
  out.WriteString(inner);
  out.Trim();
  return bytes;
}

std::string bomb_of(const std::string& facts, const std::string& request, const std::string& answer = "") {
  return file_of([&](TarZstWriter& writer) {
    add(writer, "job.pb", facts);
    add(writer, "request.pb", request);
    if (!answer.empty()) add(writer, "answer.pb", answer);
  });
}

TEST(Bundles, MayNotBecomeInMemoryWhatIsOutOfProportion) {
  const std::string facts = small_bundle().facts.SerializeAsString(), request = small_bundle().request;
  const std::size_t count = 15'000'000;
  const std::string blocks = empty_messages(v1::SolveRequest::kCoupledFieldNumber, count);
  const std::string rows = empty_messages(v1::GetJobResponse::kTraceFieldNumber, count);
  std::string trace;
  {
    google::protobuf::io::StringOutputStream stream(&trace);
    google::protobuf::io::CodedOutputStream out(&stream);
    out.WriteTag(v1::JobBundle::kJobFieldNumber << 3 | 2);
    out.WriteVarint32(static_cast<std::uint32_t>(rows.size()));
    out.WriteString(rows);
  }
  for (const auto& [file, part] :
       {std::pair(bomb_of(facts, blocks), "request.pb: "), std::pair(bomb_of(trace, request), "job.pb: "),
        std::pair(bomb_of(facts, request, empty_messages(v1::SolveResponse::kSolutionFieldNumber, count)),
                  "answer.pb: ")}) {
    EXPECT_LT(file.size(), 20'000U);
    expect_refused(file, part);
  }
  const std::string large(std::size_t{70} << 20, '\0');
  expect_refused(bomb_of(facts, large), "a file of this size may have at most");
  EXPECT_LT(resident_bytes(getpid()), std::int64_t{1} << 30);
}

TEST(Bundles, WithPartsMissingTwiceOrOfAnotherKindAreRefused) {
  const Bundle bundle = small_bundle();
  const std::string facts = bundle.facts.SerializeAsString();
  expect_refused(file_of([&](TarZstWriter& writer) { add(writer, "job.pb", facts); }),
                 "request.pb is not in it");
  expect_refused(file_of([&](TarZstWriter& writer) {
                   add(writer, "job.pb", facts);
                   add(writer, "other/job.pb", facts);
                 }),
                 "job.pb is in it twice");
  expect_refused(file_of([&](TarZstWriter& writer) {
                   add(writer, "job.pb", "\xff\xff\xff");
                   add(writer, "request.pb", bundle.request);
                 }),
                 "job.pb is no marble.v1.JobBundle");
  expect_refused(file_of([&](TarZstWriter& writer) {
                   add(writer, "job.pb", facts);
                   add(writer, "request.pb", bundle.request + bundle.request);
                 }),
                 "request.pb has");
}

TEST(Bundles, OfAnotherFolderAndWithOtherFilesAreReadAndNothingIsWritten) {
  const Bundle bundle = small_bundle();
  const auto read = read_bundle(file_of([&](TarZstWriter& writer) {
    add(writer, "../../../etc/marble/job.pb", bundle.facts.SerializeAsString());
    add(writer, "/request.pb", bundle.request);
    add(writer, "notes.txt", "It fails every morning.");
  }));
  ASSERT_TRUE(read) << read.error().message();
  EXPECT_EQ(read->request, bundle.request);
}

}  // namespace
}  // namespace marble::testing
