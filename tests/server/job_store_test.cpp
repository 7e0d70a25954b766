// The file behind --state-dir, by itself.
#include "store/job_store.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <future>
#include <map>

#include "support/child_process.h"

namespace marble::server {
namespace {

class StoreTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<JobStore> open() const {
    auto store = JobStore::open(directory_.file("state"), log_);
    EXPECT_TRUE(store.has_value()) << store.error().message();
    return std::move(*store);
  }
  static Expected<void> settled(JobStore& store) {
    std::promise<Expected<void>> ended;
    store.when_settled([&](const Expected<void>& how) { ended.set_value(how); });
    return ended.get_future().get();
  }
  [[nodiscard]] std::string file() const { return directory_.file("state") + "/jobs.sqlite"; }

  testing::TemporaryDirectory directory_;
  Log log_{"text", "off", 4096};
};

StoredJob job(const std::string& id) {
  return {.id = id,
          .client = "client",
          .request_id = "of " + id,
          .digest = std::string("\0\xff", 2),
          .peer = "ipv4:127.0.0.1:1",
          .traceparent = "00-1",
          .priority = 2,
          .accepted_unix_s = 12.5,
          .request = std::string("a\0b", 3)};
}

std::vector<std::string> ids(JobStore& store) {
  std::vector<std::string> result;
  const auto jobs = store.unanswered().value();
  for (const StoredJob& one : jobs) result.push_back(one.id);
  return result;
}

TEST_F(StoreTest, GivesBackWhatItWasGiven) {
  {
    const auto store = open();
    store->add(job("b"), {});
    store->add(job("a"), {});
    ASSERT_TRUE(settled(*store).has_value());
  }
  const auto store = open();
  EXPECT_EQ(ids(*store), (std::vector<std::string>{"b", "a"})) << "in the order they came";
  const StoredJob back = store->unanswered().value().front();
  EXPECT_EQ(back.client, "client");
  EXPECT_EQ(back.request_id, "of b");
  EXPECT_EQ(back.digest, std::string("\0\xff", 2));
  EXPECT_EQ(back.peer, "ipv4:127.0.0.1:1");
  EXPECT_EQ(back.traceparent, "00-1");
  EXPECT_EQ(back.priority, 2);
  EXPECT_EQ(back.accepted_unix_s, 12.5);
  EXPECT_FALSE(back.cancelled);
  EXPECT_EQ(store->request_of("b").value(), std::string("a\0b", 3));
}

TEST_F(StoreTest, ARequestThatIsToBeKeptStaysWithItsAnswerUntilItIsForgotten) {
  const auto store = open();
  store->add(job("a"), {});
  store->finish({.id = "a", .job = "reported", .keeps_request = true}, {});
  ASSERT_TRUE(settled(*store).has_value());
  EXPECT_EQ(store->request_of("a").value(), job("a").request);
  const auto bytes = [&] {
    std::int64_t reported = 0;
    EXPECT_TRUE(
        store->each_result([&](const StoredResult& one) { reported = one.request_bytes; }).has_value());
    return reported;
  };
  EXPECT_EQ(bytes(), static_cast<std::int64_t>(job("a").request.size()));
  store->forget_request("a");
  ASSERT_TRUE(settled(*store).has_value());
  EXPECT_EQ(store->request_of("a").error().code, ErrorCode::not_found);
  EXPECT_EQ(bytes(), -1) << "the answer is there still";
}

TEST_F(StoreTest, AnAnswerTakesTheRequestsPlace) {
  const auto store = open();
  store->add(job("a"), {});
  store->add(job("b"), {});
  store->cancel("b");
  store->finish({.id = "a", .job = "reported", .answer = std::string("x\0y", 3), .finished_unix_s = 3.0}, {});
  store->finish({.id = "never heard of", .job = "reported"}, {});
  store->finish({.id = "a", .job = "a second one"}, {});
  ASSERT_TRUE(settled(*store).has_value());
  EXPECT_EQ(ids(*store), (std::vector<std::string>{"b"}));
  EXPECT_TRUE(store->unanswered().value().front().cancelled);
  std::vector<StoredResult> results;
  ASSERT_TRUE(store->each_result([&](StoredResult one) { results.push_back(std::move(one)); }).has_value());
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].id, "a");
  EXPECT_EQ(results[0].request_id, "of a");
  EXPECT_EQ(results[0].job, "reported") << "the first answer stays";
  EXPECT_EQ(results[0].answer, std::string("x\0y", 3));
  EXPECT_EQ(results[0].finished_unix_s, 3.0);
  EXPECT_EQ(store->request_of("a").error().code, ErrorCode::not_found);
  EXPECT_EQ(results[0].request_bytes, -1);
  store->forget("a");
  store->forget("b");
  ASSERT_TRUE(settled(*store).has_value());
  EXPECT_EQ(JobStore::check(directory_.file("state")).value(),
            file() + ": ok, 0 jobs without an answer, 0 with one");
}

TEST_F(StoreTest, CountsWhatItWrote) {
  const auto store = open();
  const StoreUsage before = store->usage();
  EXPECT_TRUE(before.written);
  EXPECT_EQ(before.changes, 0);
  EXPECT_GT(before.bytes, 0);
  constexpr int kJobs = 50;
  for (int i = 0; i < kJobs; ++i) store->add(job(std::to_string(i)), {});
  store->cancel("1");
  ASSERT_TRUE(settled(*store).has_value());
  const StoreUsage after = store->usage();
  EXPECT_EQ(after.changes, kJobs + 1);
  EXPECT_GE(after.commits, 1);
  EXPECT_LE(after.commits, kJobs + 2);
  EXPECT_GT(after.commit_s, before.commit_s);
  EXPECT_GT(after.bytes, before.bytes);
}

TEST_F(StoreTest, ReportsEverybodyOnceAlsoAtItsEnd) {
  constexpr int kJobs = 200;
  std::atomic<int> kept = 0;
  {
    const auto store = open();
    for (int i = 0; i < kJobs; ++i)
      store->add(job(std::to_string(i)), [&](const Expected<void>& how) { kept += how ? 1 : 0; });
    store->close();
    EXPECT_EQ(kept, kJobs);
    EXPECT_TRUE(store->is_settled());
    EXPECT_EQ(settled(*store).error().code, ErrorCode::unavailable) << "it has closed";
  }
  EXPECT_EQ(ids(*open()).size(), static_cast<std::size_t>(kJobs));
}

TEST_F(StoreTest, RefusesAnotherProgramsFileAndALaterVersion) {
  std::filesystem::create_directory(directory_.file("state"));
  {
    auto database = Database::open(file());
    ASSERT_TRUE(database.has_value());
    ASSERT_TRUE(database->run("CREATE TABLE theirs (x)").has_value());
  }
  const auto theirs = JobStore::open(directory_.file("state"), log_);
  ASSERT_FALSE(theirs.has_value());
  EXPECT_EQ(theirs.error().bound, "is a file of another program");
  std::filesystem::remove(file());
  open().reset();
  {
    auto database = Database::open(file());
    ASSERT_TRUE(database->run("PRAGMA user_version = 7").has_value());
  }
  const auto later = JobStore::open(directory_.file("state"), log_);
  ASSERT_FALSE(later.has_value());
  EXPECT_EQ(later.error().bound, "is of version 7, this server knows 3");
  EXPECT_EQ(JobStore::check(directory_.file("nowhere")).error().bound, "No such file or directory");
}

std::int64_t lost(JobStore& store) { return store.unanswered().value().front().lost; }

TEST_F(StoreTest, CountsTheStartsThatItsProcessDidNotSurvive) {
  {
    const auto store = open();
    store->add(job("a"), {});
    ASSERT_TRUE(settled(*store).has_value());
    store->began({"a", 1});
    store->began({"never heard of", 1});  // not an id of ours: it is not written
  }
  EXPECT_EQ(lost(*open()), 1);
  EXPECT_EQ(lost(*open()), 1) << "counted once";
  {
    const auto store = open();
    store->began({"a", 2});
    store->ended("a");
  }
  EXPECT_EQ(lost(*open()), 1) << "it had ended";
  {
    const auto store = open();
    store->began({"a", 2});
  }
  EXPECT_EQ(lost(*open()), 2);
}

TEST_F(StoreTest, CountsNoStartOfAMachineThatWasStartedAnew) {
  {
    const auto store = open();
    store->add(job("a"), {});
    ASSERT_TRUE(settled(*store).has_value());
  }
  const std::string running = directory_.file("state") + "/running";
  for (const std::string& left :
       {std::string("boot-of-before\na 1\n"), std::string("a 1\n"), std::string(), std::string(300, '\xff'),
        testing::read_file(running) + "a\na -1\na x\n \n"}) {
    std::ofstream(running, std::ios::trunc) << left;
    EXPECT_EQ(lost(*open()), 0) << left;
  }
  std::ofstream(running, std::ios::app) << "a 1\n";
  EXPECT_EQ(lost(*open()), 1);
}

TEST_F(StoreTest, ItsFilesAreForItsUserAlone) {
  const std::string directory = directory_.file("state");
  std::filesystem::create_directory(directory);
  ASSERT_EQ(chmod(directory.c_str(), 0755), 0);
  const auto modes = [&] {
    std::map<std::string, unsigned> all;
    for (const auto& entry : std::filesystem::directory_iterator(directory)) {
      struct stat facts = {};
      EXPECT_EQ(lstat(entry.path().c_str(), &facts), 0);
      all[entry.path().filename()] = facts.st_mode & ALLPERMS;
    }
    return all;
  };
  const std::map<std::string, unsigned> narrow = {{"jobs.sqlite", 0600},
                                                  {"jobs.sqlite-shm", 0600},
                                                  {"jobs.sqlite-wal", 0600},
                                                  {"lock", 0600},
                                                  {"running", 0600}};
  const mode_t before = umask(0);
  auto store = open();
  store->add(job("a"), {});
  EXPECT_TRUE(settled(*store).has_value());
  EXPECT_EQ(modes(), narrow);
  store.reset();
  // Of a server that made them as the umask was.
  for (const auto& [name, mode] : narrow) {
    const std::string file = directory + "/" + name;
    if (std::filesystem::exists(file)) {
      EXPECT_EQ(chmod(file.c_str(), 0644), 0);
    }
  }
  store = open();
  store->add(job("b"), {});
  EXPECT_TRUE(settled(*store).has_value());
  EXPECT_EQ(modes(), narrow);
  umask(before);
}

}  // namespace
}  // namespace marble::server
