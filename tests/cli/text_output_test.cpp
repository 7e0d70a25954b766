#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "output/iteration_table.h"
#include "output/json.h"
#include "output/text_table.h"
#include "plain_text.h"
#include "support/child_process.h"
#include "terminal/line.h"

namespace marble::cli {
namespace {

// The iteration table, and what it shows while no iteration ends.
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

// Text of others: what steers a terminal is replaced, or escaped in JSON.

// One of each range, first and last: C0, DEL and C1, soft hyphen, marks, separators, embeddings and
// overrides, isolates, the byte order mark, annotations.
const char* const kControls[] = {
    "\x01",         "\x07",         "\t",           "\n",           "\r",           "\x1b",
    "\x1f",         "\x7f",         "\xc2\x80",     "\xc2\x9b",     "\xc2\x9f",     "\xc2\xad",
    "\xd8\x9c",     "\xe1\xa0\x8e", "\xe2\x80\x8b", "\xe2\x80\x8e", "\xe2\x80\x8f", "\xe2\x80\xa8",
    "\xe2\x80\xa9", "\xe2\x80\xaa", "\xe2\x80\xad", "\xe2\x80\xae", "\xe2\x81\xa0", "\xe2\x81\xa6",
    "\xe2\x81\xa9", "\xe2\x81\xaf", "\xef\xbb\xbf", "\xef\xbf\xb9", "\xef\xbf\xbb"};
const char* const kPlain[] = {"a", "~", " ", "\xc2\xa0", "é", "ψ", "漢", "א", "🙂", "…", "\xef\xbf\xbd"};
// Lone and cut bytes, forms that are too long, half a pair, beyond the last character.
const char* const kNoText[] = {"\x80",     "\x9b",         "\xc3",         "\xff",
                               "\xc0\x8a", "\xe0\x80\x9b", "\xed\xa0\x80", "\xf5\x80\x80\x80"};

TEST(PlainText, ReplacesControlsAndKeepsTheRest) {
  EXPECT_EQ(without_controls(std::string_view("\0", 1)), "?");
  for (const std::string control : kControls)
    EXPECT_EQ(without_controls("a" + control + "b"), "a?b") << control;
  for (const std::string plain : kPlain) EXPECT_EQ(without_controls("a" + plain + "b"), "a" + plain + "b");
  EXPECT_EQ(without_controls(""), "");
}

TEST(PlainText, ReplacesBytesThatAreNoUtf8) {
  for (const std::string bytes : kNoText) {
    const std::string shown = without_controls("a" + bytes + "b");
    EXPECT_EQ(shown, "a" + std::string(bytes.size(), '?') + "b");
  }
  EXPECT_EQ(without_controls("cut \xe2\x80"), "cut ??");
}

TEST(PlainText, JsonHasTheSameValueInBytesThatSteerNothing) {
  for (const std::string control : kControls) {
    const Json json = {{"name" + control, control + "x" + control}, {"number", 1.5}};
    const std::string text = line(json);
    EXPECT_EQ(without_controls(text), text);
    EXPECT_EQ(Json::parse(text), json);
  }
  EXPECT_EQ(with_escaped_controls("\"\xe2\x80\xae é\""), "\"\\u202e é\"");
}

TEST(PlainText, TablesAndScreensHaveNone) {
  const bool unicode = set_terminal_locale();
  for (const std::string control : kControls) {
    EXPECT_EQ(shown_text("a" + control + "b", unicode), "a?b");
    TextTable table({"name"});
    table.add({"a" + control + "b"});
    EXPECT_EQ(table.text(), "name\na?b\n");
  }
}

TEST(PlainText, IsCutByCharactersAndEndsInAnEllipsis) {
  EXPECT_EQ(terminal_text("ψψψψ", 4), "ψψψψ");
  EXPECT_EQ(terminal_text("ψψψψψ", 4), "ψψψ…");
  EXPECT_EQ(terminal_text("a\xe2\x80\xae"
                          "bcd",
                          4),
            "a?b…");
}

}  // namespace
}  // namespace marble::cli
