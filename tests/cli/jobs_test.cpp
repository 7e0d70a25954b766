// The commands about jobs: submit, result, jobs, job, watch, cancel, delete; as text and as JSON.
#include <regex>

#include "cli_test.h"
#include "long_options.h"

namespace marble::testing {
namespace {

class JobCommands : public Cli {
 protected:
  Result marble(const std::string& arguments) { return run(arguments + " --server " + server_.address()); }
  static std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }
  std::string submit(const std::string& arguments) { return first_line(marble("submit " + arguments).out); }
  std::string good() { return quoted(file("good.json", kGood)); }
  // Takes the one worker until it is cancelled.
  std::string submit_long() {
    const std::string path = file("long.pb", long_request().problem().SerializeAsString());
    const std::string id = submit(long_options() + " " + quoted(path));
    EXPECT_TRUE(eventually([&] { return marble("jobs --state running").out.find(id) != std::string::npos; }));
    return id;
  }

  ServerProcess server_{MARBLE_SERVER_BINARY, {"--workers", "1"}};
};

TEST_F(JobCommands, SubmitPrintsIdsAndResultTheAnswers) {
  const Result submitted = marble("submit " + good() + " " + good());
  EXPECT_EQ(submitted.exit_code, 0) << submitted.err;
  const std::string first = first_line(submitted.out);
  const std::string second = first_line(submitted.out.substr(first.size() + 1));
  EXPECT_NE(first, second);
  const Result result = marble("result --wait " + first + " " + second);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("good: solved  (2 variables, 0 equalities, 0 inequalities, 1 pairs)"),
            std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("(job " + second + ")"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("objective       0.5"), std::string::npos);
}

TEST_F(JobCommands, SubmitAndResultSpeakJson) {
  const Result submitted = marble("submit --priority batch --output json " + good() + " missing.json");
  EXPECT_EQ(submitted.exit_code, 2);
  const auto lines = submitted.lines();
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0]["name"], "good");
  EXPECT_EQ(lines[1]["error"]["code"], "not_found");
  const std::string id = lines[0]["job_id"];
  const Result result = marble("result --wait --output json " + id);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const Json answer = result.lines().at(0);
  EXPECT_EQ(answer["job_id"], id);
  EXPECT_EQ(answer["status"], "solved");
  EXPECT_EQ(answer["z"].size(), 2U);
  EXPECT_FALSE(answer.contains("file"));
  EXPECT_EQ(marble("job --output json " + id).lines().at(0)["priority"], "batch");
}

TEST_F(Cli, SubmitWaitsForAFullServerAndReportsItOnce) {
  const ServerProcess server(MARBLE_SERVER_BINARY, {"--workers", "1", "--client-queued", "1"});
  const auto marble = [&](const std::string& arguments) {
    return start(arguments + " --client-name lab --server " + server.address());
  };
  const std::string path = file("long.pb", long_request().problem().SerializeAsString());
  const std::string good = quoted(file("good.json", kGood));
  const std::string id = marble("submit" + long_options() + " " + quoted(path)).wait().out;
  const std::string blocker = id.substr(0, id.find('\n'));
  ASSERT_TRUE(
      eventually([&] { return !marble("jobs --output json --state running").wait().lines().empty(); }));
  const Run submit = marble("submit --queue-wait 300 " + good + " " + good + " " + good);
  ASSERT_TRUE(eventually([&] { return !read_file(submit.err).empty(); }));
  EXPECT_EQ(marble("cancel " + blocker).wait().exit_code, 0);
  const Result submitted = submit.wait();
  EXPECT_EQ(submitted.exit_code, 0) << submitted.err;
  EXPECT_EQ(std::count(submitted.out.begin(), submitted.out.end(), '\n'), 3) << submitted.out;
  EXPECT_EQ(std::count(submitted.err.begin(), submitted.err.end(), '\n'), 1) << submitted.err;
  EXPECT_NE(submitted.err.find("waits for the server: client_queued"), std::string::npos) << submitted.err;
}

TEST_F(Cli, SubmitWithoutAWaitIsRefused) {
  const ServerProcess server(MARBLE_SERVER_BINARY, {"--workers", "1", "--client-queued", "1"});
  const std::string name = " --client-name lab --server " + server.address();
  const std::string path = quoted(file("long.pb", long_request().problem().SerializeAsString()));
  const std::string submit = "submit --queue-wait 0 --output json" + long_options() + " ";
  ASSERT_EQ(run(submit + path + name).exit_code, 0);
  ASSERT_TRUE(eventually([&] { return !run("jobs --output json --state running" + name).lines().empty(); }));
  const Result two = run(submit + path + " " + path + name);
  EXPECT_EQ(two.exit_code, 3);
  EXPECT_EQ(two.lines().at(1)["error"]["field"], "client_queued");
  EXPECT_EQ(two.err.find("waits"), std::string::npos) << two.err;
  EXPECT_EQ(run("submit --queue-wait -1 " + path + name).exit_code, 2);
}

TEST_F(JobCommands, AFolderIsSubmittedAsOneArray) {
  const std::string folder = directory_.file("study");
  std::filesystem::create_directory(folder);
  for (const char* name : {"b.json", "a.json", "c.json"}) std::ofstream(folder + "/" + name) << kGood;
  const std::string again = "submit --array --request-id study " + quoted(folder) + " " + good();
  const auto submit_it = [&] {
    return run(again + " --server " + server_.address(), "/dev/null", {"MARBLE_CLIENT_NAME=study"});
  };
  const Result submitted = submit_it();
  EXPECT_EQ(submitted.exit_code, 0) << submitted.err;
  const std::string id = first_line(submitted.out);
  EXPECT_EQ(first_line(submit_it().out), id) << "sent again it is the same job";
  const Result result = marble("result --wait " + id);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find(id + "[3]: solved  objective 0.5"), std::string::npos) << result.out;
  EXPECT_EQ(marble("result --wait --output json --after 1 " + id).lines().size(), 3U);
  const Json job = marble("job --output json " + id).lines().at(0);
  EXPECT_EQ(job["kind"], "array");
  EXPECT_EQ(job["array"]["elements"], 4);
  EXPECT_EQ(job["array"]["solved"], 4);
  EXPECT_NE(marble("job " + id).out.find("4 of 4"), std::string::npos);
}

TEST_F(JobCommands, AnArrayWithAFileThatCannotBeReadIsNotSubmitted) {
  const Result submitted = marble("submit --array " + good() + " missing.json");
  EXPECT_EQ(submitted.exit_code, 2);
  EXPECT_TRUE(submitted.out.empty());
  EXPECT_NE(submitted.err.find("missing.json"), std::string::npos) << submitted.err;
  EXPECT_EQ(marble("jobs --output json").lines().size(), 0U);
}

TEST_F(JobCommands, WithoutWaitAnArrayReportsWhatThereIs) {
  const std::string running = submit_long();
  const std::string id = first_line(marble("submit --array " + good() + " " + good()).out);
  const Result nothing = marble("result " + id);
  EXPECT_EQ(nothing.exit_code, 1);
  EXPECT_TRUE(nothing.out.empty());
  EXPECT_EQ(marble("cancel " + running).exit_code, 0);
  EXPECT_EQ(marble("result --wait " + id).exit_code, 0);
  const Result all = marble("result " + id);
  EXPECT_EQ(all.exit_code, 0) << all.err;
  EXPECT_EQ(std::count(all.out.begin(), all.out.end(), '\n'), 2);
}

TEST_F(JobCommands, JobReportsTheTraceThatTheEnvironmentGave) {
  const std::string trace = "4bf92f3577b34da6a3ce929d0e0e4736";
  const Result solved = run("solve --output json " + good() + " --server " + server_.address(), "/dev/null",
                            {"TRACEPARENT=00-" + trace + "-00f067aa0ba902b7-01"});
  ASSERT_EQ(solved.exit_code, 0) << solved.err;
  const Json answer = solved.lines().at(0);
  EXPECT_EQ(answer["traceparent"].get<std::string>().substr(3, 32), trace);
  const std::string id = answer["job_id"];
  EXPECT_EQ(marble("job --output json " + id).lines().at(0)["trace_id"], trace);
  EXPECT_NE(marble("job " + id).out.find("trace          " + trace), std::string::npos);
}

TEST_F(JobCommands, AnUnfinishedResultExitsOneAndAnUnknownOneTwo) {
  const std::string id = submit_long();
  const Result unfinished = marble("result " + id);
  EXPECT_EQ(unfinished.exit_code, 1);
  EXPECT_NE(unfinished.err.find("has not finished"), std::string::npos) << unfinished.err;
  const Result unknown = marble("result --output json nothing");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_EQ(unknown.lines().at(0)["error"]["code"], "not_found");
  EXPECT_EQ(unknown.lines().at(0)["job_id"], "nothing");
  EXPECT_EQ(run("result x --server 127.0.0.1:1").exit_code, 3);
}

TEST_F(JobCommands, CtrlCEndsTheWaitingNotTheJob) {
  const std::string id = submit_long();
  const Run waiting = start("result --wait " + id + " --server " + server_.address());
  ASSERT_TRUE(eventually([&] { return waiting.process->catches(SIGINT, MARBLE_ALL_BINARY); }));
  waiting.process->send(SIGINT);
  const Result result = waiting.wait();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("cancelled by the caller"), std::string::npos) << result.err;
  EXPECT_EQ(marble("job --output json " + id).lines().at(0)["state"], "running");
}

TEST_F(JobCommands, JobsListsThemNewestFirst) {
  const std::string running = submit_long();
  const std::string waiting = submit("--client-name lab " + good());
  const Result table = marble("jobs");
  EXPECT_EQ(table.exit_code, 0) << table.err;
  EXPECT_EQ(first_line(table.out).rfind("job ", 0), 0U);
  EXPECT_NE(first_line(table.out).find("n/n_e/n_i/n_c"), std::string::npos) << table.out;
  EXPECT_LT(table.out.find(waiting), table.out.find(running)) << table.out;
  EXPECT_NE(table.out.find("queued behind 0"), std::string::npos) << table.out;
  EXPECT_NE(table.out.find("2/0/0/1"), std::string::npos) << table.out;
  const auto queued = marble("jobs --output json --state queued --state finished").lines();
  ASSERT_EQ(queued.size(), 1U);
  EXPECT_EQ(queued[0]["job_id"], waiting);
  EXPECT_EQ(queued[0]["queue_position"], 0);
  const Result page = marble("jobs --limit 1");
  EXPECT_NE(page.out.find("and more: --before " + waiting), std::string::npos) << page.out;
  EXPECT_EQ(marble("jobs --output json --before " + waiting).lines().at(0)["job_id"], running);
  EXPECT_EQ(marble("jobs --output json --client nobody").out, "");
  EXPECT_EQ(marble("jobs --state asleep").exit_code, 2);
}

TEST_F(JobCommands, JobsShowsWhatRunningJobsAreDoing) {
  const std::string running = submit_long();
  const std::string waiting = submit(good());
  const auto row_of = [](const std::string& table, const std::string& id) {
    const std::size_t at = table.find(id);
    return table.substr(at, table.find('\n', at) - at);
  };
  std::string activity;
  ASSERT_TRUE(eventually([&] {
    const Json job = marble("jobs --output json --state running").lines().at(0);
    activity = job.value("activity", "");
    return activity.rfind("path", 0) == 0;
  }));
  const std::string table = marble("jobs").out;
  EXPECT_NE(first_line(table).find("activity"), std::string::npos) << table;
  EXPECT_NE(row_of(table, running).find("  path"), std::string::npos) << table;
  EXPECT_EQ(row_of(table, waiting).back(), '-') << table;
  EXPECT_FALSE(marble("jobs --output json --state queued").lines().at(0).contains("activity"));
}

TEST_F(JobCommands, JobsShowsHowFarASearchIs) {
  const std::string problem = file("hopper.json", run("example hopper").out);
  const std::string id = submit("--option num_starts=1000 " + quoted(problem));
  const std::regex expected("further starts: [0-9]+ of [0-9]+, best [-0-9.e]+");
  EXPECT_TRUE(eventually([&] { return std::regex_search(marble("jobs --state running").out, expected); }))
      << marble("jobs").out;
  EXPECT_EQ(marble("cancel " + id).exit_code, 0);
}

TEST_F(JobCommands, NamesOfOthersCannotDriveTheTerminal) {
  Json json = Json::parse(kGood);
  json["name"] = "\033[31mred\n\u009b and rather a long name for a column";
  const std::string id = submit(quoted(file("odd.json", json.dump())));
  ASSERT_EQ(marble("result --wait " + id).exit_code, 0);
  for (const std::string& command :
       std::vector<std::string>{"jobs", "job " + id, "result " + id, "watch " + id}) {
    const std::string out = marble(command).out;
    EXPECT_NE(out.find("?[31mred?? and"), std::string::npos) << out;
    EXPECT_EQ(out.find('\033'), std::string::npos) << command;
  }
}

TEST_F(JobCommands, JobReportsChangedOptionsTimesAndTrace) {
  const std::string id = submit("--option max_iterations=777 --option polish=false " + good());
  ASSERT_EQ(marble("result --wait " + id).exit_code, 0);
  const std::string csv = directory_.file("trace.csv");
  const Result text = marble("job " + id + " --trace " + quoted(csv));
  EXPECT_EQ(text.exit_code, 0) << text.err;
  for (const char* part : {"max_iterations=777", "polish=false", "state          finished",
                           "status         solved", " solve, ", "every iteration", "kappa"})
    EXPECT_NE(text.out.find(part), std::string::npos) << part << '\n' << text.out;
  EXPECT_EQ(text.out.find("kappa_factor"), std::string::npos) << "options that are default are left out";
  const Json json = marble("job --output json " + id).lines().at(0);
  EXPECT_EQ(json["options"]["max_iterations"], 777);
  EXPECT_EQ(json["options"]["path"], "fast");
  ASSERT_FALSE(json["trace"].empty());
  const std::string content = read_file(csv);
  EXPECT_EQ(first_line(content).rfind("iteration,outer_iteration,objective,", 0), 0U);
  EXPECT_EQ(static_cast<std::size_t>(std::count(content.begin(), content.end(), '\n')),
            json["trace"].size() + 1);
  EXPECT_EQ(marble("job nothing").exit_code, 2);
  EXPECT_EQ(marble("job " + id + " --trace /nonexistent/x").exit_code, 2);
}

TEST_F(JobCommands, JobReportsWhyItIsInfeasible) {
  const std::string path = quoted(file("clash.json", kUnsolvable));
  const std::string id = submit("--option explain=true " + path);
  ASSERT_EQ(marble("result --wait " + id).exit_code, 1);
  const Result text = marble("job " + id);
  EXPECT_NE(text.out.find("conflict       inequalities 0, 1; minimal"), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("certificate    inequality "), std::string::npos) << text.out;
  const Json why = marble("job --output json " + id).lines().at(0)["infeasibility"];
  EXPECT_EQ(why["conflict"]["inequalities"], Json({0, 1}));
  EXPECT_EQ(why["rows"].size(), 2U);
  EXPECT_EQ(why["multipliers"].size(), 2U);
  EXPECT_EQ(why["more_rows"], 0);
  EXPECT_FALSE(marble("job --output json " + submit(good())).lines().at(0).contains("infeasibility"));
}

TEST_F(JobCommands, WatchEndsWithTheJobAndItsExitCode) {
  const std::string running = submit_long();
  const std::string waiting = submit(good());
  const std::string unsolvable = submit(quoted(file("no.json", kUnsolvable)));
  const Run watch = start("watch " + waiting + " --server " + server_.address());
  ASSERT_TRUE(eventually([&] { return read_file(watch.out).find("queued") != std::string::npos; }));
  ASSERT_EQ(marble("cancel " + running).exit_code, 0);
  const Result watched = watch.wait();
  EXPECT_EQ(watched.exit_code, 0) << watched.err;
  EXPECT_NE(watched.out.find("finished  good  solved"), std::string::npos) << watched.out;
  const Result unsolved = marble("watch --output json " + unsolvable);
  EXPECT_EQ(unsolved.exit_code, 1);
  EXPECT_EQ(unsolved.lines().back()["state"], "finished");
  EXPECT_EQ(marble("watch nothing").exit_code, 2);
  EXPECT_EQ(marble("watch " + running).exit_code, 1) << "a cancelled one is not solved";
}

TEST_F(JobCommands, WatchOfAllEndsWithCtrlC) {
  const std::string id = submit_long();
  const Run watch = start("watch --output json --server " + server_.address());
  ASSERT_TRUE(eventually([&] { return read_file(watch.out).find("running") != std::string::npos; }));
  ASSERT_EQ(marble("cancel " + id).exit_code, 0);
  ASSERT_TRUE(eventually([&] { return read_file(watch.out).find("finished") != std::string::npos; }));
  EXPECT_TRUE(watch.process->running()) << "others may come";
  watch.process->send(SIGINT);
  const Result watched = watch.wait();
  EXPECT_EQ(watched.exit_code, 0) << watched.err;
  EXPECT_EQ(watched.lines().back()["job_id"], id);
}

TEST_F(JobCommands, CancelGivesTheBestIterateAndDeleteLetsGo) {
  const std::string id = submit_long();
  EXPECT_NE(marble("cancel " + id).out.find(id), std::string::npos);
  const Result result = marble("result --wait --output json " + id);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.lines().at(0)["status"], "cancelled");
  EXPECT_EQ(marble("cancel --output json " + id).lines().at(0)["state"], "finished");
  EXPECT_EQ(marble("delete " + id).out, id + " is deleted\n");
  const Result again = marble("delete --output json " + id);
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_EQ(again.lines().at(0)["error"]["code"], "not_found");
  EXPECT_EQ(marble("cancel " + id).exit_code, 2);
}

TEST_F(JobCommands, SolveReportsItsPlaceInTheQueue) {
  const std::string running = submit_long();
  const std::string before = submit(good());
  const Run solve = start("solve " + good() + " --server " + server_.address());
  ASSERT_TRUE(eventually([&] { return read_file(solve.err).find("waits behind 1") != std::string::npos; }));
  ASSERT_EQ(marble("delete " + before).exit_code, 0);
  ASSERT_TRUE(eventually([&] { return read_file(solve.err).find("is next") != std::string::npos; }));
  ASSERT_EQ(marble("cancel " + running).exit_code, 0);
  EXPECT_EQ(solve.wait().exit_code, 0);
}

}  // namespace
}  // namespace marble::testing
