// A submitted job's bundle is there while the job waits, runs and is answered for, whatever keeps it; for its
// own client and the role admin; and nothing in it says who they are.
#include "replay_test.h"
#include "support/postgres_process.h"

namespace marble::testing {
namespace {

using KeptRequests = Replay;

void expect_request(const Bundle& bundle, v1::SolveRequest sent) {
  sent.clear_request_id();
  v1::SolveRequest kept;
  ASSERT_TRUE(kept.ParseFromString(bundle.request));
  EXPECT_EQ(kept.SerializeAsString(), sent.SerializeAsString());
}

TEST_F(KeptRequests, InMemoryWhileTheJobWaitsAndRunsAndHasItsAnswer) {
  Node node({"--workers", "1"});
  const std::string running = node.submit(long_request());
  ASSERT_TRUE(eventually([&] { return node.job(running).state() == v1::JOB_STATE_RUNNING; }));
  const std::string waiting = node.submit(numbered(7));
  expect_request(read(bundle_of(node, running)), long_request());
  expect_request(read(bundle_of(node, waiting)), numbered(7));
  ASSERT_TRUE(node.cancel(running).ok());
  finish(node, waiting);
  const std::string path = bundle_of(node, waiting);
  expect_request(read(path), numbered(7));
  expect_same(path);
  EXPECT_TRUE(node.remove(waiting).ok());
  EXPECT_EQ(node.bundle(waiting).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(KeptRequests, OnDiskAfterAKill) {
  TemporaryDirectory state;
  const std::vector<std::string> flags = {"--workers", "1", "--state-dir", state.file("state")};
  std::string answered, waiting;
  {
    Node node(flags);
    answered = node.submit(numbered(1));
    finish(node, answered);
    const std::string running = node.submit(long_request());
    waiting = node.submit(numbered(2));
    node.kill();
  }
  Node node(flags);
  const std::string path = bundle_of(node, answered);
  expect_request(read(path), numbered(1));
  expect_same(path);
  expect_request(read(bundle_of(node, waiting)), numbered(2));
}

TEST_F(KeptRequests, InAStoreOfSeveralServersFromAnyOfThem) {
  PostgresProcess database(MARBLE_POSTGRES_DIR);
  const std::vector<std::string> flags = {"--workers", "1", "--state", database.uri()};
  Node a(flags), b(flags);
  const std::string id = a.submit(numbered(3));
  expect_answer(b, id, 3);
  for (Node* node : {&a, &b}) {
    const std::string path = bundle_of(*node, id);
    expect_request(read(path), numbered(3));
    expect_same(path);
  }
  EXPECT_TRUE(b.remove(id).ok());
  EXPECT_EQ(a.bundle(id).error_code(), grpc::StatusCode::NOT_FOUND);
  const std::string running = a.submit(long_request());
  ASSERT_TRUE(eventually([&] { return b.job(running).state() == v1::JOB_STATE_RUNNING; }));
  expect_request(read(bundle_of(b, running)), long_request());
  database.stop();
  EXPECT_TRUE(eventually([&] { return a.bundle(running).error_code() == grpc::StatusCode::UNAVAILABLE; }));
  database.start();
  EXPECT_TRUE(eventually([&] { return a.bundle(running).ok(); }));
  EXPECT_TRUE(a.cancel(running).ok());
}

TEST_F(KeptRequests, NotWhereNoneAreToBeMadeOrTheJobWasNotSubmitted) {
  TemporaryDirectory state;
  for (const std::vector<std::string>& kept :
       {std::vector<std::string>{}, std::vector<std::string>{"--state-dir", state.file("state")}}) {
    std::vector<std::string> flags = {"--bundles", "0"};
    flags.insert(flags.end(), kept.begin(), kept.end());
    Node node(flags);
    const std::string id = node.submit(numbered(1));
    finish(node, id);
    EXPECT_NE(node.bundle(id).error_code(), grpc::StatusCode::OK);
  }
  Node node({});
  ASSERT_TRUE(node.solves());
  const std::set<std::string> jobs = node.list();
  ASSERT_EQ(jobs.size(), 1U);
  const grpc::Status status = node.bundle(*jobs.begin());
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_NE(status.error_message().find("only submitted jobs have one"), std::string::npos)
      << status.error_message();
}

TEST_F(KeptRequests, NotBeyondTheBytesThatAreKept) {
  Node node({"--result-bytes", "20000"});
  v1::SolveRequest large = numbered(1);
  large.mutable_problem()->set_name(std::string(200, 'x'));
  for (int i = 0; i < 4000; ++i) {  // rows 0·z + 1 >= 0
    large.mutable_problem()->add_inequality_offset(1.0);
  }
  const int columns = large.problem().gradient_size();
  v1::SparseMatrix* rows = large.mutable_problem()->mutable_inequality_matrix();
  const int before = rows->rows();
  rows->set_columns(columns);
  while (rows->column_pointers_size() < columns + 1) rows->add_column_pointers(0);
  rows->set_rows(before + 4000);
  const std::string id = node.submit(large);
  v1::SolveResponse response;
  (void)node.result(id, true, &response);
  const grpc::Status status = node.bundle(id);
  EXPECT_NE(status.error_code(), grpc::StatusCode::OK) << "its request alone has 32,000 bytes";
  const std::string small = node.submit(numbered(2));
  finish(node, small);
  EXPECT_TRUE(node.bundle(small).ok());
}

TEST_F(KeptRequests, AreForTheirClientAndTheRoleAdminAndSayNothingOfThem) {
  struct Secret {
    std::string secret, line;
  };
  const auto token = [&](const std::string& name_and_roles) {
    ChildProcess process({MARBLE_SERVER_BINARY, "--new-token", name_and_roles},
                         directory_.file(name_and_roles));
    EXPECT_EQ(process.wait(), 0);
    std::istringstream lines(process.output());
    Secret made;
    std::getline(lines, made.secret);
    std::getline(lines, made.line);
    return made;
  };
  const Secret owner = token("robotowner:solve"), other = token("other:solve"),
               viewer = token("viewer:observe"), chief = token("chief:admin");
  const std::string tokens =
      file("tokens", owner.line + "\n" + other.line + "\n" + viewer.line + "\n" + chief.line + "\n");
  Node node({"--tokens", tokens, "--http", "127.0.0.1:0"});
  const auto as = [](const Secret& who) { return std::vector<std::string>{"MARBLE_TOKEN=" + who.secret}; };
  const Result submitted =
      run("submit --server " + node.server().address() + " " + quoted(file("good.json", kGood)), "/dev/null",
          as(owner));
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  const std::string id = submitted.out.substr(0, submitted.out.find('\n'));
  ASSERT_EQ(
      run("result --wait --server " + node.server().address() + " " + id, "/dev/null", as(owner)).exit_code,
      0);
  const std::string path = bundle_path();
  const auto asked = [&](const Secret& who) { return job(node, id, "--bundle " + quoted(path), as(who)); };
  EXPECT_EQ(asked(other).exit_code, 2) << "it knows of no such job";
  const Result observer = asked(viewer);
  EXPECT_EQ(observer.exit_code, 3);
  EXPECT_NE(observer.err.find("the role admin"), std::string::npos) << observer.err;
  EXPECT_EQ(asked(chief).exit_code, 0);
  EXPECT_EQ(asked(owner).exit_code, 0);
  const auto of_page = [&](const Secret& who) {
    httplib::Client client(node.server().http());
    return client.Get("/api/jobs/" + id + "/bundle", {{"Authorization", "Bearer " + who.secret}});
  };
  EXPECT_EQ(of_page(other)->status, 404);
  EXPECT_EQ(of_page(viewer)->status, 403);
  const auto page = of_page(owner);
  ASSERT_EQ(page->status, 200);
  EXPECT_EQ(page->get_header_value("Content-Type"), "application/zstd");
  EXPECT_EQ(page->get_header_value("Content-Disposition"),
            "attachment; filename=\"marble-" + id + ".tar.zst\"");
  EXPECT_EQ(page->body, read_file(path)) << "whichever way it was asked for";
  int files = 0;
  const auto take = [&](std::string_view name, const std::string& content) {
    ++files;
    for (const std::string& word : {owner.secret, std::string("robotowner"), std::string("127.0.0.1")})
      EXPECT_EQ(content.find(word), std::string::npos) << word << " in " << name;
  };
  ASSERT_TRUE(read_parts(page->body, take));
  EXPECT_EQ(files, 8);
  v1::SolveRequest request;
  ASSERT_TRUE(request.ParseFromString(read(path).request));
  EXPECT_TRUE(request.request_id().empty()) << "the client gave one of its own";
}

}  // namespace
}  // namespace marble::testing
