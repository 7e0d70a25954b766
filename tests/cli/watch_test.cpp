// The live view without a terminal: what is known, what keys do, and what lines come of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <clocale>
#include <cmath>

#include "terminal/line.h"
#include "watch/layout.h"
#include "watch/model.h"
#include "watch/view.h"

namespace marble::cli {
namespace {

JobInfo job(const std::string& id, JobState state, double accepted_s = 1000.0) {
  JobInfo info;
  info.job_id = id;
  info.state = state;
  info.accepted_unix_s = accepted_s;
  info.client = "planner";
  info.problem_name = "hopper";
  info.variables = 1560;
  info.pairs = 480;
  if (state == JobState::finished) info.status = Status::solved;
  return info;
}

Progress row_at(std::int32_t iteration, double violation = 0.0, double kappa = 0.0) {
  Progress row;
  row.iteration = iteration;
  row.violations.equality = violation;
  row.kappa = kappa;
  return row;
}

JobEvent event_of(const JobInfo& info, std::vector<Progress> rows = {}) {
  JobEvent event;
  event.job = info;
  event.rows = std::move(rows);
  return event;
}

std::string ids(const JobTable& table, const TableView& view) {
  std::string text;
  for (const JobRow* row : table.rows(view)) text += row->job.job_id + " ";
  return text;
}

std::string text_of(const Lines& lines) {
  std::string text;
  for (const Line& line : lines) text += line.text() + "\n";
  return text;
}

bool shows(const Lines& lines, const std::string& part) {
  return text_of(lines).find(part) != std::string::npos;
}

class Watch : public ::testing::Test {
 protected:
  Watch() {
    std::setlocale(LC_CTYPE, "C.UTF-8");
    model_.address = "127.0.0.1:50051";
    ServerInfo info;
    info.version = "0.1.0";
    info.workers = 4;
    info.running = 3;
    info.uptime_s = 100.0;
    info.queued_by_priority = {0, 2, 7};
    info.estimated_wait_s = {0.0, 1.5, 90.0};
    model_.server.saw(info);
    info.uptime_s = 102.0;
    info.answered = 30;
    info.solved = 24;
    info.cpu_s = 3.0;
    model_.server.saw(info);
  }
  Lines drawn(Size size, bool unicode = true) { return layout(model_, view_, {size, unicode, 0.0}); }
  Request press(const Key& key) { return view_.press(key, model_.jobs.rows(view_.table), page_of({80, 24})); }
  void type(const std::string& text) {
    for (const char c : text) static_cast<void>(press({KeyName::text, std::string(1, c)}));
  }
  void add(const JobInfo& info) { model_.jobs.update(info); }

  Model model_;
  View view_;
};

TEST_F(Watch, RunningJobsComeFirstThenTheQueueByTurnsThenTheNewestFinished) {
  add(job("old", JobState::finished, 10));
  add(job("new", JobState::finished, 20));
  JobInfo waits = job("second", JobState::queued, 30);
  waits.queue_position = 1;
  add(waits);
  add(job("first", JobState::queued, 40));
  add(job("session", JobState::idle, 5));
  add(job("runs", JobState::running, 1));
  EXPECT_EQ(ids(model_.jobs, {}), "runs first second session new old ");
  EXPECT_EQ(ids(model_.jobs, {.reversed = true}), "old new session second first runs ");
}

TEST_F(Watch, NumbersAreSortedFromTheLargestAndNoNumberComesFirst) {
  JobInfo small = job("small", JobState::finished), large = job("large", JobState::finished),
          none = job("none", JobState::finished);
  small.violations.equality = 1e-9;
  large.violations.complementarity = 1e-3;
  none.violations.inequality = std::nan("");
  for (const JobInfo& info : {small, large, none}) add(info);
  EXPECT_EQ(ids(model_.jobs, {.by = SortBy::violation}), "none large small ");
}

TEST_F(Watch, AFilterLooksAtIdClientProblemStateStatusAndPriorityWhateverTheCase) {
  JobInfo other = job("beef", JobState::running);
  other.client = "Lab";
  other.priority = Priority::batch;
  add(other);
  add(job("cafe", JobState::finished));
  EXPECT_EQ(ids(model_.jobs, {.filter = "lAB"}), "beef ");
  EXPECT_EQ(ids(model_.jobs, {.filter = "batch"}), "beef ");
  EXPECT_EQ(ids(model_.jobs, {.filter = "solved"}), "cafe ");
  EXPECT_EQ(ids(model_.jobs, {.filter = "hop"}), "beef cafe ");
  EXPECT_EQ(ids(model_.jobs, {.filter = "nobody"}), "");
}

TEST_F(Watch, FinishedJobsAreForgottenBeyondABoundAndOthersNever) {
  add(job("runs", JobState::running));
  for (std::size_t i = 0; i < JobTable::kMostFinished + 50; ++i)
    add(job(std::to_string(i), JobState::finished));
  EXPECT_EQ(model_.jobs.size(), JobTable::kMostFinished + 1);
  EXPECT_EQ(model_.jobs.find("49"), nullptr);
  EXPECT_NE(model_.jobs.find("50"), nullptr);
  EXPECT_NE(model_.jobs.find("runs"), nullptr);
}

TEST_F(Watch, OlderNewsDoesNotBringAFinishedJobBackToLife) {
  add(job("a", JobState::finished));
  add(job("a", JobState::running));
  EXPECT_EQ(model_.jobs.find("a")->job.state, JobState::finished);
}

TEST_F(Watch, ANewListForgetsWhatIsNotInIt) {
  add(job("gone", JobState::running));
  add(job("stays", JobState::running));
  model_.jobs.replace({job("stays", JobState::finished)});
  EXPECT_EQ(ids(model_.jobs, {}), "stays ");
}

TEST_F(Watch, AThinnedHistoryKeepsTheFirstTheNewestAndItsBound) {
  Thinned<int, 8> history;
  for (int i = 0; i <= 1000; ++i) {
    history.add(i);
    ASSERT_LE(history.values().size(), 8U);
    ASSERT_EQ(history.values().front(), 0);
    ASSERT_EQ(history.values().back(), i);
  }
  const auto stride = static_cast<int>(history.stride());
  for (std::size_t i = 0; i + 1 < history.values().size(); ++i)
    EXPECT_EQ(history.values()[i], static_cast<int>(i) * stride);
}

TEST_F(Watch, RatesComeFromDifferencesAndNotAcrossARestart) {
  const auto rates = model_.server.rates();
  ASSERT_TRUE(rates);
  EXPECT_DOUBLE_EQ(rates->answers_per_s, 15.0);
  EXPECT_DOUBLE_EQ(rates->solved_share.value(), 0.8);
  EXPECT_DOUBLE_EQ(rates->cpu_share, 1.5);
  ServerInfo restarted;
  restarted.uptime_s = 1.0;
  EXPECT_FALSE(rates_between(*model_.server.info(), restarted));
}

TEST_F(Watch, TheHeaderReportsWorkersQueueRatesAndConnection) {
  const Lines lines = drawn({120, 24});
  for (const char* part : {"marble 0.1.0  connected  127.0.0.1:50051  up ", "3 of 4 busy", "15 solves/s",
                           "80 % solved", "interactive 2, ~1.5 s", "batch 7, ~90 s", "CPU 150 %"})
    EXPECT_TRUE(shows(lines, part)) << part << '\n' << text_of(lines);
  model_.server.saw(*model_.server.info(), true);
  EXPECT_TRUE(shows(drawn({40, 12}), "marble 0.1.0  draining"));
  model_.server.lost("connection refused", 0.0);
  const Lines lost = layout(model_, view_, {{120, 24}, true, 7.0});
  EXPECT_TRUE(shows(lost, "disconnected, retrying for 7 s  127.0.0.1:50051: connection refused"))
      << text_of(lost);
}

TEST_F(Watch, EveryScreenHasItsHeightAndNoLineIsWiderThanIt) {
  JobInfo wide = job("0123456789abcdef", JobState::running);
  wide.problem_name = "跳躍者の問題 with a name that does not end";
  wide.iterations = 12;
  for (int i = 0; i < 50; ++i) add(job("job" + std::to_string(i), JobState::finished));
  add(wide);
  model_.opened.emplace();
  JobEvent event = event_of(wide);
  for (int i = 0; i < 300; ++i) event.rows.push_back(row_at(i, 1e-3 / (i + 1)));
  model_.opened->update(event);
  for (const bool unicode : {true, false}) {
    for (const char* opened : {"", "0123456789abcdef"}) {
      view_.opened = opened;
      for (int width = 1; width <= 200; width += width < 44 ? 1 : 13) {
        for (int height = 1; height <= 60; height += height < 26 ? 1 : 11) {
          const Lines lines = drawn({width, height}, unicode);
          ASSERT_EQ(lines.size(), static_cast<std::size_t>(height)) << width;
          for (const Line& line : lines) {
            ASSERT_LE(columns_of(line.text()), width) << height << ": " << line.text();
            ASSERT_EQ(columns_of(line.text()), line.width());
          }
        }
      }
    }
  }
}

TEST_F(Watch, ASmallTerminalKeepsWhatMattersMost) {
  JobInfo runs = job("0123456789abcdef", JobState::running);
  runs.iterations = 7;
  runs.violations.equality = 0.01;
  add(runs);
  const Lines lines = drawn({40, 12});
  for (const char* part : {"3 of 4", "01234567", "running", "1.0e-02"})
    EXPECT_TRUE(shows(lines, part)) << part << '\n' << text_of(lines);
}

TEST_F(Watch, AProofShowsItsGapAndItsNodesAmongTheOthers) {
  JobInfo proof = job("0123456789abcdef", JobState::running);
  proof.iterations = 7;
  proof.violations.equality = 0.01;
  proof.nodes = 1204;
  proof.incumbent = 5.0;
  add(proof);
  EXPECT_TRUE(shows(drawn({120, 12}), "no gap"));
  for (const auto& [gap, text] : {std::pair(1.0, "gap 100%"), std::pair(0.123, "gap 12%"),
                                  std::pair(0.0123, "gap 1.2%"), std::pair(1e-6, "gap 1e-06")}) {
    proof.gap = gap;
    add(proof);
    const Lines lines = drawn({120, 12});
    EXPECT_TRUE(shows(lines, text)) << text_of(lines);
    EXPECT_TRUE(shows(lines, "1,204 nodes")) << text_of(lines);
    EXPECT_FALSE(shows(lines, "1.0e-02")) << "the violation of an iterate says nothing of a proof";
  }
  proof.proved = true;
  add(proof);
  EXPECT_TRUE(shows(drawn({120, 12}), "proved"));
}

TEST_F(Watch, WithoutUnicodeEverythingIsAscii) {
  JobInfo runs = job("a", JobState::running);
  runs.client = "Müller";
  for (int i = 1; i < 9; ++i) {
    runs.iterations = i;
    runs.violations.equality = std::pow(10.0, -i);
    add(runs);
  }
  const std::string text = text_of(drawn({120, 24}, false));
  EXPECT_TRUE(std::all_of(text.begin(), text.end(), [](char c) { return static_cast<signed char>(c) >= 0; }))
      << text;
  EXPECT_NE(text.find("M?ller"), std::string::npos);
}

TEST_F(Watch, TextOfClientsCannotDriveTheTerminal) {
  JobInfo odd = job("a", JobState::running);
  odd.problem_name = "\033[31mred\u009b\u202e\nx";
  add(odd);
  const std::string text = text_of(drawn({160, 24}));
  EXPECT_EQ(text.find('\033'), std::string::npos);
  EXPECT_NE(text.find("?[31mred???x"), std::string::npos) << text;
}

TEST_F(Watch, TheSelectionStaysWithItsJobWhenRowsMove) {
  add(job("a", JobState::running, 10));
  add(job("b", JobState::running, 5));
  EXPECT_EQ(press({KeyName::down}).kind, Request::Kind::none);
  EXPECT_EQ(view_.selected, "b");
  add(job("c", JobState::running, 20));
  const Lines lines = drawn({80, 24});
  const auto selected =
      std::find_if(lines.begin(), lines.end(), [](const Line& line) { return line.selected; });
  ASSERT_NE(selected, lines.end());
  EXPECT_EQ(selected->text().rfind("b ", 0), 0U) << selected->text();
}

TEST_F(Watch, KeysMoveWithinTheTableAndTheSelectedRowIsShown) {
  for (int i = 10; i < 90; ++i) add(job(std::to_string(i), JobState::running, i));
  for (const KeyName key : {KeyName::up, KeyName::page_down, KeyName::page_down, KeyName::end, KeyName::down,
                            KeyName::page_up, KeyName::home}) {
    static_cast<void>(press({key}));
    const Lines lines = drawn({80, 24});
    EXPECT_TRUE(std::any_of(lines.begin(), lines.end(), [](const Line& line) { return line.selected; }));
  }
  EXPECT_EQ(view_.index, 0U);
  static_cast<void>(press({KeyName::end}));
  EXPECT_EQ(view_.selected, "10");
}

TEST_F(Watch, EnterOpensAndQGoesBackThenQuits) {
  add(job("a", JobState::running));
  const Request open = press({KeyName::enter});
  EXPECT_EQ(open.kind, Request::Kind::open);
  EXPECT_EQ(open.job_id, "a");
  EXPECT_EQ(press({KeyName::text, "q"}).kind, Request::Kind::close);
  EXPECT_EQ(press({KeyName::text, "q"}).kind, Request::Kind::quit);
  view_.opened = "a";
  view_.began_opened = true;
  EXPECT_EQ(press({KeyName::escape}).kind, Request::Kind::quit) << "there is no table to go back to";
}

TEST_F(Watch, CancellingAsksAndOnlyYesDoesIt) {
  add(job("a", JobState::running));
  type("c");
  EXPECT_TRUE(shows(drawn({80, 24}), "cancel job a? y/n"));
  EXPECT_EQ(press({KeyName::enter}).kind, Request::Kind::none);
  EXPECT_EQ(view_.prompt, Prompt::none);
  type("c");
  const Request request = press({KeyName::text, "y"});
  EXPECT_EQ(request.kind, Request::Kind::cancel);
  EXPECT_EQ(request.job_id, "a");
}

TEST_F(Watch, TheQuestionIsAboutTheJobThatWasSelectedWhenItWasAsked) {
  add(job("a", JobState::running, 10));
  type("c");
  add(job("b", JobState::running, 20));
  static_cast<void>(drawn({80, 24}));
  EXPECT_EQ(press({KeyName::text, "y"}).job_id, "a");
}

TEST_F(Watch, WhatIsTypedAfterASlashFilters) {
  add(job("a", JobState::running));
  add(job("q", JobState::finished));
  type("/q");
  EXPECT_TRUE(shows(drawn({80, 24}), "filter: q"));
  EXPECT_EQ(press({KeyName::enter}).kind, Request::Kind::none);
  EXPECT_EQ(ids(model_.jobs, view_.table), "q ");
  EXPECT_TRUE(shows(drawn({80, 24}), "only q  Esc shows all")) << "that rows are missing is reported";
  EXPECT_EQ(press({KeyName::escape}).kind, Request::Kind::none) << "Esc shows all again before it quits";
  EXPECT_EQ(ids(model_.jobs, view_.table), "a q ");
}

TEST_F(Watch, SGoesThroughTheSortOrdersAndRReverses) {
  for (int i = 0; i < kSortBys; ++i) {
    EXPECT_EQ(static_cast<int>(view_.table.by), i);
    type("s");
  }
  EXPECT_EQ(view_.table.by, SortBy::activity);
  type("r");
  EXPECT_TRUE(view_.table.reversed);
}

TEST_F(Watch, AnOpenedJobShowsFactsCurvesRowsAndWhyItEnded) {
  JobInfo info = job("0123456789abcdef", JobState::running);
  info.iterations = 3;
  JobEvent event = event_of(info);
  event.trace.emplace();
  for (int i = 0; i < 4; ++i) event.trace->rows.push_back(row_at(i, std::pow(10.0, -i), 1.0));
  model_.opened.emplace();
  model_.opened->update(event);
  view_.opened = info.job_id;
  for (const char* part : {"0123456789abcdef", "running", "1560/0/0/480", "largest violation", "KKT residual",
                           "kappa", "1e-03", "iteration", "complem."})
    EXPECT_TRUE(shows(drawn({100, 40}), part)) << part << '\n' << text_of(drawn({100, 40}));
  info.state = JobState::finished;
  info.status = Status::iteration_limit;
  info.detail = "max_iterations = 3 reached; complementarity 1.0e-03";
  info.times.solve_s = 0.5;
  model_.opened->update(event_of(info));
  for (const char* part : {"iteration_limit", "max_iterations = 3 reached", "solve 500 ms", "line search"})
    EXPECT_TRUE(shows(drawn({100, 40}), part)) << part << '\n' << text_of(drawn({100, 40}));
  model_.opened->gone = true;
  EXPECT_TRUE(shows(drawn({140, 40}), "not known to the server any more"));
}

TEST_F(Watch, AnOpenedProofShowsIncumbentAndBoundClosingAndItsNodes) {
  JobInfo info = job("0123456789abcdef", JobState::running);
  JobEvent event = event_of(info);
  event.trace.emplace();
  event.trace->rows.push_back(row_at(7, 0.0, 1.0));
  for (int i = 1; i <= 20; ++i) {
    Progress row = row_at(7);
    row.elapsed_s = 0.5 * i;
    row.nodes = 1000 * i;
    row.incumbent = -2.0;
    row.bound = -2.0 - 1.0 / i;
    event.trace->rows.push_back(row);
  }
  event.job.nodes = 20000;
  event.job.open_nodes = 37;
  event.job.incumbent = -2.0;
  event.job.bound = -2.05;
  event.job.gap = 0.025;
  model_.opened.emplace();
  model_.opened->update(event);
  view_.opened = info.job_id;
  for (const char* part : {"incumbent -2", "bound -2.05", "gap 2.5e-02", "nodes 20,000", "open 37",
                           "nodes/s 2000", "■ incumbent", "■ bound", "seconds"})
    EXPECT_TRUE(shows(drawn({100, 40}), part)) << part << '\n' << text_of(drawn({100, 40}));
  event.job.state = JobState::finished;
  event.job.status = Status::solved;
  event.job.proved = true;
  event.job.gap = 5e-7;
  model_.opened->update(event);
  EXPECT_TRUE(shows(drawn({120, 40}), "proved optimal: gap 5.0e-07, 20,000 nodes"))
      << text_of(drawn({120, 40}));
}

TEST_F(Watch, WhatDoesNotFitBesideGoesToTheNextLineAndOfRowsTheLeastImportantColumnsGo) {
  JobInfo info = job("0123456789abcdef", JobState::finished);
  info.times = {
      .setup_s = 1e-3, .factorization_s = 0.3, .line_search_s = 0.1, .solve_s = 0.5, .polish_s = 2.0};
  model_.opened.emplace();
  model_.opened->update(event_of(info, {row_at(1), row_at(2)}));
  view_.opened = info.job_id;
  const Lines at_80 = drawn({80, 30});
  for (const char* part : {"of it factorizations 300 ms", "polish 2 s", " fact", "complem."})
    EXPECT_TRUE(shows(at_80, part)) << part << '\n' << text_of(at_80);
  EXPECT_FALSE(shows(at_80, "regular.")) << text_of(at_80);
  EXPECT_TRUE(shows(drawn({100, 30}), "regular.  fact")) << text_of(drawn({100, 30}));
}

TEST_F(Watch, LongTextIsBrokenAtBlanksAndNeverWithinACharacter) {
  const auto broken = [](const char* text, int width, std::size_t most = 9) {
    std::string all;
    for (const Line& line : wrapped(text, width, most, Style::plain)) all += line.text() + "|";
    return all;
  };
  EXPECT_EQ(broken("is not cancelled: admin", 10), "is not|cancelled:|admin|");
  EXPECT_EQ(broken("is not cancelled: admin", 16, 1), "is not|");
  EXPECT_EQ(broken("is not cancelled: admin", 17), "is not cancelled:|admin|");
  EXPECT_EQ(broken("aaaaaa bb", 4), "aaaa|aa|bb|");
  EXPECT_EQ(broken("éééé é", 3), "ééé|é é|");
  EXPECT_EQ(broken("跳躍者", 5), "跳躍|者|");
  EXPECT_EQ(broken("跳躍", 1), "跳|躍|");
  EXPECT_EQ(broken("", 4), "");
  model_.notice = "job 0123456789abcdef is not cancelled: it is another client's, which takes the role admin";
  const Lines lines = drawn({60, 12});
  EXPECT_TRUE(shows(lines, "client's, which takes the role admin")) << text_of(lines);
}

TEST_F(Watch, HowAJobEndedIsReadableInFullAt90Columns) {
  JobInfo info = job("0123456789abcdef", JobState::finished);
  info.status = Status::locally_infeasible;
  info.priority = Priority::interactive;
  add(info);
  const Lines lines = drawn({90, 24});
  EXPECT_TRUE(shows(lines, " inter locally_infeasible ")) << text_of(lines);
}

TEST_F(Watch, TheNextUpdateOfASessionBeginsANewCurve) {
  OpenedJob opened;
  opened.update(event_of({}, {row_at(1), row_at(2)}));
  opened.update(event_of({}, {row_at(1)}));
  EXPECT_EQ(opened.trace.values().size(), 1U);
  EXPECT_EQ(opened.newest.size(), 3U);
}

}  // namespace
}  // namespace marble::cli
