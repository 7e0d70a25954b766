// `solve --trace` and `marble plot`: every iteration in a file, and pictures of it.
#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "cli_test.h"
#include "marble/progress.h"

namespace marble::testing {
namespace {

class Trace : public Cli {
 protected:
  std::string rocket() {
    const std::string path = directory_.file("rocket.json");
    if (!std::filesystem::exists(path)) file("rocket.json", run("example rocket").out);
    return quoted(path);
  }
  static std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) lines.push_back(line);
    return lines;
  }
  // Without the time, which no two solves share.
  static std::string without_time(const std::string& line) {
    std::size_t begin = 0;
    for (const ProgressColumn& column : progress_columns()) {
      if (column.name == "elapsed_s") break;
      begin = line.find(',', begin) + 1;
    }
    return std::string(line).erase(begin, line.find(',', begin) - begin);
  }
  std::string trace() {
    const std::string path = directory_.file("trace.csv");
    EXPECT_EQ(run("solve --local --quiet --trace " + quoted(path) + " " + rocket()).exit_code, 0);
    return path;
  }
  static unsigned number_at(const std::string& bytes, std::size_t at) {  // big-endian
    unsigned value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes.at(at + i));
    return value;
  }
};

TEST_F(Trace, HasARowForEachOneOfTheTableAndTheSameFromAServer) {
  const std::string here = directory_.file("here.csv"), there = directory_.file("there.csv");
  const Result local = run("solve --local --output json --trace " + quoted(here) + " " + rocket());
  ASSERT_EQ(local.exit_code, 0) << local.err;
  const auto rows = lines_of(read_file(here));
  EXPECT_EQ(rows.at(0), progress_csv_header());
  auto table = lines_of(local.err);
  std::erase_if(table, [](const std::string& line) { return line.find("iter") != std::string::npos; });
  ASSERT_EQ(rows.size() - 1, table.size()) << local.err;
  for (std::size_t i = 0; i < table.size(); ++i)
    EXPECT_EQ(std::stoi(rows[i + 1]), std::stoi(table[i])) << "the iteration of row " << i;

  ServerProcess server(MARBLE_SERVER_BINARY);
  const Result remote =
      run("solve --quiet --server " + server.address() + " --trace " + quoted(there) + " " + rocket());
  ASSERT_EQ(remote.exit_code, 0) << remote.err;
  const auto same = lines_of(read_file(there));
  ASSERT_EQ(same.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(without_time(same[i]), without_time(rows[i]));
}

TEST_F(Trace, OfAJobHasTheSameRows) {
  ServerProcess server(MARBLE_SERVER_BINARY);
  const std::string path = directory_.file("job.csv");
  const Json answer =
      run("solve --quiet --output json --server " + server.address() + " " + rocket()).lines().at(0);
  const std::string id = answer["job_id"];
  ASSERT_EQ(run("job " + id + " --server " + server.address() + " --trace " + quoted(path)).exit_code, 0);
  const auto of_job = lines_of(read_file(path)), of_solve = lines_of(read_file(trace()));
  ASSERT_EQ(of_job.size(), of_solve.size());
  for (std::size_t i = 0; i < of_job.size(); ++i)
    EXPECT_EQ(without_time(of_job[i]), without_time(of_solve[i]));
}

TEST_F(Trace, AFileThatCannotBeWrittenIsReportedBeforeTheSolve) {
  const Result result = run("solve --local --trace /nonexistent/t.csv " + rocket());
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_EQ(result.err, "marble: /nonexistent/t.csv: cannot be written: No such file or directory\n");
  EXPECT_EQ(result.out, "");
  const Result several = run("solve --local --trace t.csv " + rocket() + " " + rocket());
  EXPECT_EQ(several.exit_code, 2);
  EXPECT_NE(several.err.find("must go with one FILE, not 2"), std::string::npos) << several.err;
}

TEST_F(Trace, AnOlderFileStaysWhereNothingWasSolvedAndNothingIsLeftBeside) {
  const std::string path = file("trace.csv", "old");
  EXPECT_EQ(run("solve --local --trace " + quoted(path) + " " + quoted(file("bad.json", "{"))).exit_code, 2);
  EXPECT_EQ(read_file(path), "old");
  trace();
  EXPECT_NE(read_file(path), "old");
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(path).parent_path()))
    EXPECT_NE(entry.path().extension(), ".part") << entry.path();
}

TEST_F(Trace, IsPlottedAsAPictureOfItsSizeWhateverItsName) {
  const std::string csv = trace();
  for (const std::string name : {"out.png", "it's a \"picture\"\n$(x).png"}) {
    const std::string path = directory_.file(name);
    std::string shell_quoted = path;
    for (std::size_t at = 0; (at = shell_quoted.find('\'', at)) != std::string::npos; at += 4)
      shell_quoted.replace(at, 1, "'\\''");
    const Result result = run("plot " + quoted(csv) + " -o " + quoted(shell_quoted));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const std::string png = read_file(path);
    ASSERT_GT(png.size(), 5000U);
    EXPECT_EQ(png.substr(0, 8), "\x89PNG\r\n\x1a\n");
    EXPECT_EQ(number_at(png, 16), 1200U);
    EXPECT_EQ(number_at(png, 20), 900U);
  }
  const std::string svg = directory_.file("out.svg");
  ASSERT_EQ(run("plot " + quoted(csv) + " --columns kkt_residual,step_length -o " + quoted(svg)).exit_code,
            0);
  const std::string text = read_file(svg);
  EXPECT_NE(text.find("<svg"), std::string::npos);
  EXPECT_NE(text.find("</svg>"), std::string::npos);
  EXPECT_NE(text.find("kkt_residual"), std::string::npos);
  EXPECT_EQ(text.find("kappa"), std::string::npos);
}

TEST_F(Trace, IsPlottedInTheTerminalWithoutGnuplot) {
  const std::string csv = trace();
  const Result here = run("plot " + quoted(csv), "/dev/null", {"LC_ALL=C.UTF-8"});
  EXPECT_EQ(here.exit_code, 0) << here.err;
  for (const char* part : {"kkt_residual", "kappa", "objective", "│", "iteration"})
    EXPECT_NE(here.out.find(part), std::string::npos) << part << '\n' << here.out;
  EXPECT_EQ(here.out.find('\033'), std::string::npos) << "no colours where there is no terminal";
  const std::string png = directory_.file("none.png");
  const std::string path = std::getenv("PATH");
  setenv("PATH", "/nonexistent", 1);
  const Result without = run("plot " + quoted(csv) + " -o " + quoted(png));
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(without.exit_code, 2) << "there is no picture";
  EXPECT_NE(without.err.find("gnuplot is not installed"), std::string::npos) << without.err;
  EXPECT_NE(without.out.find("kkt_residual"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(png));
}

TEST_F(Trace, OfBeforeThereWereTreesIsPlottedToo) {
  std::string old;
  for (const ProgressColumn& column : progress_columns().first(kColumnsBeforeTrees))
    old += (old.empty() ? "" : ",") + std::string(column.name);
  old += "\n0,0,-3,0.5,0,0.25,1,10,1e6,0,0,1,0.001\n1,0,-4,0,0,0,1e-9,1e-8,1e6,1,0,2,0.002\n";
  const Result result = run("plot --columns kkt_residual " + quoted(file("old.csv", old)));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("kkt_residual"), std::string::npos) << result.out;
}

TEST_F(Trace, WhatIsNoTraceIsRefusedWithLineAndColumn) {
  const auto refused = [&](const std::string& arguments, const std::string& why) {
    const Result result = run("plot " + arguments);
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_NE(result.err.find(why), std::string::npos) << result.err;
  };
  refused(quoted(file("bad.csv", progress_csv_header() + "\n0,0,zero,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n")),
          "bad.csv: line 2, column objective = \"zero\": must be a number");
  refused(rocket(), "rocket.json: line 1, column 1");
  refused(quoted(directory_.file("missing")), "cannot be read");
  refused(quoted(trace()) + " -o out.pdf", "must end in .png or .svg");
  refused(quoted(trace()) + " --columns kapa", "kapa");
}

}  // namespace
}  // namespace marble::testing
