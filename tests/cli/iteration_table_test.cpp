// The iteration table, and what it shows while no iteration ends.
#include "output/iteration_table.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>

#include "support/child_process.h"

namespace marble::cli {
namespace {

using testing::TemporaryDirectory;

struct Close {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

// Written through one handle and read through another: the table may write at any time.
class Table : public ::testing::Test {
 protected:
  [[nodiscard]] std::string text() const {
    std::ifstream file(directory_.file("table"));
    return {std::istreambuf_iterator<char>(file), {}};
  }
  TemporaryDirectory directory_;
  std::unique_ptr<std::FILE, Close> file_{std::fopen(directory_.file("table").c_str(), "w")};
  IterationTable table_{false, file_.get()};
};

TEST_F(Table, SaysNothingOfTheActivityWhileRowsCome) {
  table_.report({.iteration = 1});
  table_.show("further starts: 1 of 16");
  std::fflush(file_.get());
  EXPECT_EQ(text().find("further"), std::string::npos);
}

TEST_F(Table, SaysWhatTheSolveIsDoingOnceNothingWasWrittenForAWhile) {
  const std::string activity = "further starts: 1 of 16";
  while (text().find(activity) == std::string::npos) table_.show(activity);
  table_.report({.iteration = 1});
  std::fflush(file_.get());
  const std::string all = text();
  EXPECT_EQ(all.find(activity), all.rfind(activity)) << "once: " << all;
  EXPECT_LT(all.find(activity), all.find("iter"));
}

TEST_F(Table, TheDisplayReadsTheMonitorUntilItIsGone) {
  ActivityDisplay display(table_);
  display.monitor()->enter(Phase::tree, 0);
  display.monitor()->set_done(Phase::tree, 7, 0);
  while (text().find("branch and bound: 7 nodes") == std::string::npos) std::this_thread::yield();
}

}  // namespace
}  // namespace marble::cli
