// Little bars, curves of dots, traces in files and gnuplot's commands, as values.
#include <gtest/gtest.h>

#include <clocale>
#include <cmath>
#include <limits>

#include "marble/progress.h"
#include "output/convergence.h"
#include "output/proof.h"
#include "output/trace_file.h"
#include "terminal/terminal_plot.h"

namespace marble::cli {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string spark(std::vector<double> values, int width = 20, bool unicode = false) {
  return sparkline(values, width, unicode);
}

TEST(Sparkline, GoesDownADecadeAtATime) {
  EXPECT_EQ(spark({1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7}), "#*+=-:._");
  EXPECT_EQ(spark({1, 1e-7}, 20, true), "█▁");
}

TEST(Sparkline, AFlatHistoryLooksFlat) { EXPECT_EQ(spark({1.0, 1.01, 0.99}), "###"); }

TEST(Sparkline, ZeroIsTheLowestAndWhatIsNoNumberIsSaid) {
  EXPECT_EQ(spark({1, 0, kNan, -1}), "#_?_");
  EXPECT_EQ(spark({0, 0}), "__");
  EXPECT_EQ(spark({}), "");
}

TEST(Sparkline, ALongHistoryShowsTheWorstOfEachShare) {
  EXPECT_EQ(spark({1e-7, 1, 1e-7, 1e-7}, 2), "#_");
  EXPECT_EQ(spark({1e-7, kNan, 1, 1}, 2), "?#");
}

class TerminalPlot : public ::testing::Test {
 protected:
  TerminalPlot() { std::setlocale(LC_CTYPE, "C.UTF-8"); }
  static std::string drawn(const std::vector<Curve>& curves, const PlotLook& look) {
    std::vector<double> x;
    for (std::size_t i = 0; i < curves.front().values.size(); ++i) x.push_back(static_cast<double>(i));
    std::string text;
    for (const Line& line : terminal_plot(x, curves, look)) text += line.text() + '\n';
    return text;
  }
};

TEST_F(TerminalPlot, AGeometricFallIsAStraightLineOnALogAxis) {
  EXPECT_EQ(drawn({{"v", 'v', Style::series_1, {1, 1e-2, 1e-4}}}, {{26, 7}, true, false}),
            "v v\n"
            "1e+00 |vvvvv              \n"
            "      |     vvvv          \n"
            "      |         vvvvv     \n"
            "      |              vvvv \n"
            "1e-04 |                  v\n"
            "      0    iteration     2\n");
}

TEST_F(TerminalPlot, AnExactZeroOfAViolationHasARowOfItsOwn) {
  const std::string text = drawn({{"v", 'v', Style::series_1, {1, 1e-4, 0}, true}}, {{40, 8}, true, false});
  EXPECT_NE(text.find("    0 |"), std::string::npos) << text;
}

TEST_F(TerminalPlot, WhatHasNoPlaceOnTheAxisIsLeftOut) {
  for (const double odd : {0.0, -1.0, kNan, std::numeric_limits<double>::infinity()}) {
    const std::string text = drawn({{"k", 'k', Style::series_1, {odd, odd, odd}}}, {{40, 8}, true, false});
    EXPECT_EQ(text.find('k', text.find('\n')), std::string::npos) << odd << '\n' << text;
  }
}

TEST_F(TerminalPlot, SpecksOfRoundingDoNotStretchTheAxis) {
  const std::string text = drawn({{"v", 'v', Style::series_1, {1, 1e-300}}}, {{40, 8}, true, false});
  EXPECT_NE(text.find("1e-24"), std::string::npos) << text;
}

TEST_F(TerminalPlot, ALinearAxisTakesConstantsAndNegatives) {
  EXPECT_NE(drawn({{"o", 'o', Style::series_1, {-3, 5}}}, {{40, 8}, false, false}).find("-3 |"),
            std::string::npos);
  EXPECT_NE(drawn({{"o", 'o', Style::series_1, {7, 7}}}, {{40, 8}, false, false}).find("ooo"),
            std::string::npos);
}

TEST_F(TerminalPlot, DotsAreBrailleAndLinesAreAsWideAsTheyMayBe) {
  std::vector<double> x{0, 1};
  const Curve curve{"v", 'v', Style::series_1, {1, 1e-3}};
  for (const Line& line : terminal_plot(x, std::vector{curve}, {{50, 10}, true, true}))
    EXPECT_LE(columns_of(line.text()), 50) << line.text();
  EXPECT_TRUE(terminal_plot(x, std::vector{curve}, {{23, 10}, true, true}).empty());
  EXPECT_TRUE(terminal_plot(x, std::vector{curve}, {{50, 4}, true, true}).empty());
}

std::string trace_text(const std::vector<Progress>& rows) {
  std::string text = progress_csv_header() + "\n";
  for (const Progress& row : rows) {
    append_progress_csv(row, text);
    text += '\n';
  }
  return text;
}

Progress row_at(std::int32_t iteration, double kappa = 0.0, std::int32_t factorizations = 0) {
  Progress row;
  row.iteration = iteration;
  row.kappa = kappa;
  row.factorizations = factorizations;
  return row;
}

TEST(TraceFile, WhatWasWrittenIsReadToTheBit) {
  Progress row = row_at(4, 1e-300, 7);
  row.objective = 0.1;
  row.violations = {1.0 / 3.0, 0, 5e-324};
  row.elapsed_s = 1e-5;
  row.incumbent = -2.5;  // the bound is not known yet, which is -inf
  row.nodes = 12;
  const auto rows = parse_trace(trace_text({row}));
  ASSERT_TRUE(rows) << rows.error().message();
  EXPECT_EQ(trace_text(*rows), trace_text({row}));
}

TEST(TraceFile, FaultsNameLineAndColumn) {
  const std::string good = trace_text({{}});
  const auto message = [](const std::string& text) {
    const auto rows = parse_trace(text);
    return rows ? "none" : rows.error().message();
  };
  EXPECT_EQ(message(""), "line 1, column 1: is no trace: must be iteration");
  EXPECT_EQ(message("iteration,foo\n"), "line 1, column 2 = \"foo\": is no trace: must be outer_iteration");
  EXPECT_EQ(message(progress_csv_header() + "\n"), "line 2: has no row: nothing to plot");
  EXPECT_EQ(message(good + "1,2,3\n"), "line 3: has 3 columns: must have 18");
  EXPECT_EQ(message(good + "1,2,x,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n"),
            "line 3, column objective = \"x\": must be a number");
  EXPECT_EQ(message(good + "1e99,2,3,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n"),
            "line 3, column iteration = \"1e99\": must be an integer in [0, 2147483647]");
  EXPECT_EQ(message(good + "\n" + good), "line 3: has 1 columns: must have 18");
}

TEST(TraceFile, OfBeforeThereWereTreesHasNoneInIt) {
  std::string old;
  for (const ProgressColumn& column : progress_columns().first(kColumnsBeforeTrees))
    old += (old.empty() ? "" : ",") + std::string(column.name);
  const auto rows = parse_trace(old + "\n3,2,-0.5,0,0,0,0,0,0,0,0,7,0.25\n");
  ASSERT_TRUE(rows) << rows.error().message();
  EXPECT_EQ(rows->front().elapsed_s, 0.25);
  EXPECT_EQ(rows->front().bound, Progress{}.bound);
  const auto mixed = parse_trace(old + "\n3,2,-0.5,0,0,0,0,0,0,0,0,7,0.25,1,1,1,1,1\n");
  ASSERT_FALSE(mixed);
  EXPECT_EQ(mixed.error().message(), "line 2: has 18 columns: must have 13");
}

TEST(TraceFile, LineEndsOfWindowsAreTaken) {
  std::string text = trace_text({row_at(1), row_at(2)});
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2) text.insert(at, "\r");
  ASSERT_TRUE(parse_trace(text));
  EXPECT_EQ(parse_trace(text)->size(), 2U);
}

TEST(Gnuplot, PicturesAreChosenByTheEndOfTheName) {
  EXPECT_EQ(picture_format("a b.PNG"), PictureFormat::png);
  EXPECT_EQ(picture_format("x.svg"), PictureFormat::svg);
  EXPECT_EQ(picture_format("png"), std::nullopt);
}

TEST(Gnuplot, ATitleCannotBeACommand) {
  std::vector<const ProgressColumn*> columns{&progress_columns()[3]};
  const std::vector<Progress> rows{row_at(0), row_at(1)};
  const std::string script =
      trace_picture(rows, progress_columns()[0], columns, PictureFormat::png, "a'\nsystem \"x\" `y`$(z)");
  EXPECT_NE(script.find("set title 'a__system _x_ _y__(z)' noenhanced\n"), std::string::npos) << script;
}

TEST(Gnuplot, OfATreeTheGapIsLogarithmicAndWhatIsNotKnownIsNotDrawn) {
  Progress begin = row_at(1), later = row_at(1);
  begin.nodes = 1, begin.elapsed_s = 0.5, begin.incumbent = -1.0;  // no bound yet
  later.nodes = 9, later.elapsed_s = 1.5, later.incumbent = -2.0, later.bound = -3.0, later.gap = 0.5;
  std::vector<const ProgressColumn*> columns;
  const ProgressColumn* time = nullptr;
  for (const ProgressColumn& column : progress_columns()) {
    if (column.name == "gap" || column.name == "incumbent" || column.name == "bound")
      columns.push_back(&column);
    if (column.name == "elapsed_s") time = &column;
  }
  const std::string script =
      trace_picture(std::vector{begin, later}, *time, columns, PictureFormat::svg, "t");
  EXPECT_NE(script.find("0.5 NaN -1 NaN NaN\n1.5 NaN -2 -3 0.5\n"), std::string::npos) << script;
  EXPECT_NE(script.find("set xlabel 'elapsed_s'"), std::string::npos) << script;
  EXPECT_LT(script.find("title 'gap'"), script.find("unset logscale y")) << script;
  EXPECT_GT(script.find("title 'bound'"), script.find("unset logscale y")) << script;
}

TEST(Proof, IsReportedInWords) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(proof_text({Status::solved, true, -4.0, 3e-7, 1204, 0}),
            "proved optimal: gap 3.0e-07, 1,204 nodes");
  EXPECT_EQ(proof_text({Status::infeasible, true, kInfinity, kInfinity, 1, 0}), "proved infeasible: 1 node");
  EXPECT_EQ(proof_text({Status::time_limit, false, -4.25, 0.0625, 1234567, 37}),
            "not proved: bound -4.25, gap 6.2e-02, 1,234,567 nodes, 37 open");
  EXPECT_EQ(proof_text({{}, false, -kInfinity, kInfinity, 999, 4}),
            "not proved yet: no bound, 999 nodes, 4 open");
  EXPECT_EQ(proof_text({Status::infeasible, true, kInfinity, kInfinity, 0, 0}), "")
      << "a certificate, no tree";
}

TEST(Proof, TheRateOfNodesIsThatOfTheLastTenthOfTheTime) {
  std::vector<Progress> rows(1);
  EXPECT_FALSE(nodes_per_s(rows)) << "no tree yet";
  for (int i = 1; i <= 100; ++i) {
    rows.push_back(row_at(5));
    rows.back().elapsed_s = 0.1 * i;
    rows.back().nodes = i <= 50 ? i : 50 + 100 * (i - 50);  // it became faster
  }
  ASSERT_TRUE(nodes_per_s(rows));
  EXPECT_NEAR(*nodes_per_s(rows), 1000.0, 1e-6);
}

TEST(Gnuplot, RepeatedFactorizationsAreMarkedOnThePathAlone) {
  const Progress before = row_at(1, 1.0, 1);
  EXPECT_TRUE(repeats_factorization(before, row_at(2, 1.0, 3)));
  EXPECT_FALSE(repeats_factorization(before, row_at(2, 1.0, 2)));
  EXPECT_FALSE(repeats_factorization(before, row_at(2, 0.0, 9)));
}

}  // namespace
}  // namespace marble::cli
