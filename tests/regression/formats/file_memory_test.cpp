// One file that is too large among others ended `marble solve` with 3, "server unreachable", though no server
// was asked; a Matrix Market file of 60 bytes took 8.4 GB before it was refused.
//
// Memory that is not there could not be distinguished from a server's refusal; sizes in headers were
// allocated as they stood.
#include <gtest/gtest.h>

#include <fstream>

#include "matrix_market.h"
#include "support/child_process.h"

namespace marble::formats {
namespace {

using marble::testing::ChildProcess;
using marble::testing::read_file;
using marble::testing::TemporaryDirectory;

constexpr const char* kTiny = R"({"n":1,"c0":0,"g":[-2],"Q":{"rows":1,"cols":1,"i":[0],"j":[0],"v":[2]}})";
constexpr const char* kBanner = "%%MatrixMarket matrix coordinate real general\n";

TEST(FileMemory, AHeaderCannotAskForMoreThanTheFilesLengthAllows) {
  for (const char* sizes : {"1 2147483647 0\n", "2147483647 1 0\n", "2147483647 2147483647 0\n"}) {
    const auto read = parse_matrix_market(
        {{"Q", std::string(kBanner) + sizes}, {"g", std::string(kBanner) + sizes}}, "header");
    ASSERT_FALSE(read.has_value());
    EXPECT_EQ(read.error().field, "Q");
    EXPECT_EQ(read.error().value, "line 2");
    EXPECT_NE(read.error().bound.find("must hold an integer in [0, 105"), std::string::npos)
        << read.error().bound;
  }
}

TEST(FileMemory, ATooLargeFileIsABadFileAndTheOthersAreSolved) {
  if (MARBLE_SANITIZED) GTEST_SKIP() << "a sanitizer needs the address space that is limited here";
  const TemporaryDirectory folder;
  std::ofstream(folder.file("first.json")) << kTiny;
  std::ofstream(folder.file("last.json")) << kTiny;
  {
    std::ofstream large(folder.file("large.json"));
    large << R"({"n":1,"g":[1],"A":{"rows":1,"cols":1,"i":[)";
    for (int i = 0; i < 60'000'000; ++i) large << "0,";  // 120 MB; as integers 240 MB, and copied as it grows
    large << "0]}}";
  }
  const std::string out = folder.file("out");
  ChildProcess marble({"/bin/sh", "-c",
                       "ulimit -v 500000; exec '" MARBLE_BINARY "' solve --local --quiet --output json '" +
                           folder.file("first.json") + "' '" + folder.file("large.json") + "' '" +
                           folder.file("last.json") + "'"},
                      out);
  EXPECT_EQ(marble.wait(), 2);
  const std::string reported = read_file(out);
  EXPECT_NE(reported.find("large.json: is too large for the memory there is"), std::string::npos) << reported;
  std::size_t solved = 0;
  for (std::size_t at = 0; (at = reported.find("\"status\":\"solved\"", at)) != std::string::npos; ++at)
    ++solved;
  EXPECT_EQ(solved, 2U) << reported;
}

}  // namespace
}  // namespace marble::formats
