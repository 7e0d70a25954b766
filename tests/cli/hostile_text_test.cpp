// Names in files, of files and of jobs that hold control and bidirectional characters: none of them reaches a
// terminal or a log, whichever command shows them.
#include "cli_test.h"
#include "formats/nl_writer.h"
#include "plain_text.h"

namespace marble::testing {
namespace {

// A right-to-left override, an isolate, ESC ], BEL, a C1 control and a byte that is no UTF-8.
constexpr const char* kHostile = "\xe2\x80\xae\xe2\x81\xa6\x1b]0;owned\x07\xc2\x9b\x9b";

class HostileText : public Cli {
 protected:
  static void expect_plain(const std::string& text, const std::string& what) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) EXPECT_EQ(without_controls(line), line) << what;
  }
  Result checked(const std::string& arguments, int exit_code) {
    Result result = run(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << arguments << result.err;
    EXPECT_NE(result.out + result.err, "") << arguments;
    expect_plain(result.out, arguments);
    expect_plain(result.err, arguments);
    return result;
  }
  // A file of that name, with a problem of that name.
  std::string problem(const std::string& end = ".json", std::string content = "") {
    Json json = Json::parse(kGood);
    json["name"] = "name\u202e\u2066\x1b]0;\x07\u009b";
    return quoted(file(std::string("file") + kHostile + end, content.empty() ? json.dump() : content));
  }
};

TEST_F(HostileText, OfFilesIsNotShownBySolving) {
  for (const std::string format : {"", " --output json", " --quiet"})
    checked("solve --local" + format + " " + problem() + " " + problem(), 0);
  checked("solve --local " + quoted(directory_.file(std::string("none") + kHostile)), 2);
  checked("solve --local " + problem(".json", "no JSON \xe2\x80\xae"), 2);
  checked("solve --local " + problem(".nl", "g no header"), 2);
  checked(std::string("solve --local --option '") + kHostile + "=1' " + problem(), 2);
  checked("convert " + problem() + " " + quoted(directory_.file(std::string("out") + kHostile + ".none")), 2);
  checked(std::string("no\xe2\x80\xae") + "command", 2);
}

TEST_F(HostileText, OfNonlinearFilesIsNotShown) {
  NlWriter nl(false, 1, 0, 1);
  nl.key('O').integer(0).integer(0).operation(44).variable(0);
  nl.key('x').integer(1).entry(0, 0.5);
  nl.key('b').between(0.0, 1.0);
  nl.key('G').integer(0).integer(1).entry(0, 0.0);
  const std::string path = problem(".nl", nl.content());
  checked("solve --local " + path, 0);
  checked("solve --local --output json " + path, 0);
}

TEST_F(HostileText, OfJobsIsNotShownByAnyCommandOrLog) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--workers", "1"});
  const std::string at = " --server " + server.address();
  for (const std::string format : {"", " --output json"}) {
    checked("solve" + format + at + " " + problem(), 0);
    checked("batch" + format + at + " " + problem(), 0);
    checked("submit" + format + at + " " + problem() + " " + problem(".bad.json", "{}"), 2);
    const std::string id = run("submit" + at + " " + problem()).out.substr(0, 16);
    checked("result --wait" + format + at + " " + id, 0);
    checked("job" + format + at + " " + id, 0);
    checked("jobs" + format + at, 0);
    checked("watch --plain" + format + at + " " + id, 0);
    checked(std::string("job") + format + at + " '" + kHostile + "'", 2);
  }
  expect_plain(server.log(), "log");
}

TEST_F(HostileText, OfAServersAddressIsNotShown) {
  checked(std::string("info --server 'unix:/none") + kHostile + "'", 3);
}

}  // namespace
}  // namespace marble::testing
