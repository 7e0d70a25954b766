// Bundles as files: whole or refused as damaged, whatever the bytes.
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <random>

#include "replay_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

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
                               if (auto reported = report(zeros); !reported) return reported;
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
