#include "cli_test.h"
#include "formats/nl_writer.h"
#include "plain_text.h"

namespace marble::testing {
namespace {

// Files that are no problems: what is wrong and where is said, and the server lives on.
struct BadFile {
  const char* name;
  std::string content;
  const char* message;  // part of what must be said, after the file's name
};

// Noise that is the same each time.
std::string noise(std::size_t size) {
  std::string bytes(size, '\0');
  std::uint32_t state = 12345;
  for (char& byte : bytes) {
    state = state * 1664525U + 1013904223U;
    byte = static_cast<char>(state >> 24);
  }
  return bytes;
}

std::string with(const char* key, const std::string& value) {
  Json json = Json::parse(kGood);
  json.erase(key);
  std::string text = json.dump();
  text.insert(1, std::string("\"") + key + "\":" + value + ",");
  return text;
}

std::string repeated(const std::string& text, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) all += text;
  return all;
}

class BadFiles : public Cli, public ::testing::WithParamInterface<BadFile> {};

TEST_P(BadFiles, GetAnErrorThatNamesFileFieldAndRuleLocallyAndRemotely) {
  const std::string path = file(std::string(GetParam().name) + ".json", GetParam().content);
  ServerProcess server(MARBLE_SERVER_BINARY);
  for (const std::string& where : {std::string("--local"), "--server " + server.address()}) {
    const Result result = run("solve --quiet --output json " + where + " " + quoted(path));
    EXPECT_EQ(result.exit_code, 2) << where;
    EXPECT_NE(result.err.find(std::string(GetParam().name) + ".json: "), std::string::npos) << result.err;
    EXPECT_NE(result.err.find(GetParam().message), std::string::npos) << result.err;
    EXPECT_LT(result.err.size(), 1000U);
    EXPECT_EQ(result.lines().at(0)["status"], "error");
  }
  const Result health = run("health --server " + server.address());
  EXPECT_EQ(health.out, "serving\n") << "exit " << health.exit_code << ": " << health.err << server.log();
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, BadFiles,
    ::testing::Values(
        BadFile{"truncated", std::string(kGood).substr(0, 90), "is not JSON"},
        BadFile{"noise", noise(10'000'000), "is not JSON"}, BadFile{"empty", "", "is empty"},
        BadFile{"blank", "  \n", "is empty"}, BadFile{"array", "[1, 2]", "must be a JSON object"},
        BadFile{"no_variables", with("n", "0"), "n = 0: must be a whole number in [1, 2^28)"},
        BadFile{"huge_n", with("n", "1e300"), "n = 1e+300: must be a whole number"},
        BadFile{"text_n", with("n", "\"two\""), "n = \"two\": must be a whole number in [1, 2^28)"},
        BadFile{"short_gradient", with("g", "[1]"), "g = 1 entries: must have 2 entries"},
        BadFile{"nan", with("g", "[1, NaN]"), "g[1] = NaN: must be a finite number"},
        BadFile{"null_entry", with("g", "[1, null]"), "g[1] = null: must be a finite number"},
        BadFile{"infinite", with("g", "[1, -1e999]"), "g[1] = -1e999: must be a finite number"},
        BadFile{"row_out_of_range", with("L", R"({"rows":1,"cols":2,"i":[1],"j":[0],"v":[1]})"),
                "L.i[0] = 1: must be in [0, 1)"},
        BadFile{"column_out_of_range", with("L", R"({"rows":1,"cols":2,"i":[0],"j":[2],"v":[1]})"),
                "L.j[0] = 2: must be in [0, 2)"},
        BadFile{"negative_index", with("L", R"({"rows":1,"cols":2,"i":[-1],"j":[0],"v":[1]})"),
                "L.i[0] = -1: must be in [0, 1)"},
        BadFile{"fractional_index", with("L", R"({"rows":1,"cols":2,"i":[0.5],"j":[0],"v":[1]})"),
                "L.i[0] = 0.5: must be a whole number"},
        BadFile{"wrong_columns", with("L", R"({"rows":1,"cols":3,"i":[0],"j":[0],"v":[1]})"),
                "L.cols = 3: must be 2 (n)"},
        BadFile{"huge_columns", with("L", R"({"rows":1,"cols":200000000,"i":[0],"j":[0],"v":[1]})"),
                "L.cols = 200000000: must be 2 (n)"},
        BadFile{"rows_without_offsets", with("L", R"({"rows":2,"cols":2,"i":[0],"j":[0],"v":[1]})"),
                "L.rows = 2: must be 1"},
        BadFile{"negative_rows", with("L", R"({"rows":-1,"cols":2,"i":[],"j":[],"v":[]})"),
                "L.rows = -1: must be"},
        BadFile{"missing_values", with("L", R"({"rows":1,"cols":2,"i":[0],"j":[0]})"), "L.v: is missing"},
        BadFile{"uneven_triplets", with("L", R"({"rows":1,"cols":2,"i":[0],"j":[0,1],"v":[1,1]})"),
                "L.i = 1 entries: must have 2 entries"},
        BadFile{"uneven_pairs", with("r", "[0, 1]"), "r = 2 entries: must have 1 entries, as many as l"},
        BadFile{"asymmetric", with("Q", R"({"rows":2,"cols":2,"i":[0,0],"j":[0,1],"v":[2,1]})"),
                "Q must be symmetric"},
        BadFile{"infinite_bound", with("r", "[Infinity]"), "r[0] = Infinity: must be a finite number"},
        BadFile{"twice", with("g", "[1, 1],\"g\":[2, 2]"), "g: is there twice"},
        BadFile{"text_matrix", with("Q", "\"none\""), "Q = \"none\": must be an object"},
        BadFile{"nested_vector", with("g", "[1, [1]]"), "g[1] = an array: must be a finite number"},
        BadFile{"deep_vector", "{\"n\":1,\"g\":" + std::string(1'000'000, '['), "g[0] = an array: must be"},
        BadFile{"deep", "{\"other\":" + std::string(1'000'000, '['), "is not JSON"},
        BadFile{"deep_object", "{\"other\":" + repeated("{\"a\":", 1'000'000), "is not JSON"}),
    [](const auto& parameter) { return parameter.param.name; });

TEST_F(Cli, TruncatedBinaryIsRefused) {
  const std::string json = file("good.json", kGood);
  const std::string binary = directory_.file("good.pb");
  ASSERT_EQ(run("convert " + quoted(json) + " " + quoted(binary)).exit_code, 0);
  const std::string content = read_file(binary);
  const Result cut =
      run("solve --local --quiet " + quoted(file("cut.pb", content.substr(0, content.size() / 2))));
  EXPECT_EQ(cut.exit_code, 2);
  EXPECT_NE(cut.err.find("cut.pb: "), std::string::npos) << cut.err;
  EXPECT_EQ(run("solve --local --quiet " + quoted(file("noise.pb", noise(10'000'000)))).exit_code, 2);
  const Result unknown = run("solve --local --quiet -", file("noise", noise(10'000'000)));
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_NE(unknown.err.find("is neither JSON nor a marble.v1.Problem message"), std::string::npos);
}

// Files that nest deeply: within the stack that there is they are read and solved, beyond it they are refused
// in words.
struct Nest {
  const char* name;
  void (*open)(NlWriter&);                      // what stands before the node inside
  void (*close)(NlWriter&) = [](NlWriter&) {};  // and after it
};

class Nested : public Cli {
 protected:
  // With a stack of so many kB; 0: that of the tests.
  Result run_with_stack(int stack, const std::string& arguments) {
    const std::string out = directory_.file("out"), err = directory_.file("err");
    const std::string limit = stack > 0 ? "ulimit -s " + std::to_string(stack) + " && " : "";
    const std::string command =
        limit + "exec '" + MARBLE_BINARY + "' " + arguments + " </dev/null >'" + out + "' 2>'" + err + "'";
    ChildProcess process({"/bin/sh", "-c", command}, directory_.file("shell"), {});
    const int code = process.wait();
    return {code, read_file(out), read_file(err)};
  }
};

TEST_F(Nested, JsonIsRefusedInEveryFile) {
  const std::string good = quoted(file("good.json", kGood));
  const auto with = [&](const std::string& key) {
    const std::string open(1'000'000, '['), close(1'000'000, ']');
    return quoted(file(key + ".json", "{\"" + key + "\":" + open + close + "}"));
  };
  for (const std::string& arguments :
       {"solve --local " + with("g"), "coupled --server local " + with("blocks"),
        "coupled --server local " + with("coupling_rhs"),
        "scenarios --server local " + good + " --sampler " + with("quantities"),
        "scenarios --server local " + good + " --sampler " + with("seed"),
        "solve --local " + good + " --sensitivity " + with("forward")}) {
    const Result result = run_with_stack(256, arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments << result.err;
    EXPECT_LT(result.err.size(), 1000U);
  }
}

class NestedNl : public Nested, public ::testing::WithParamInterface<Nest> {
 protected:
  std::string nested(int depth) {
    NlWriter nl(false, 1, 0, 1);
    nl.key('O').integer(0).integer(0);
    for (int i = 0; i < depth; ++i) GetParam().open(nl);
    nl.variable(0);
    for (int i = 0; i < depth; ++i) GetParam().close(nl);
    nl.key('x').integer(1).entry(0, 0.5);
    nl.key('b').between(0.25, 0.75);
    nl.key('G').integer(0).integer(1).entry(0, 0.0);
    return quoted(file("nested.nl", nl.content()));
  }
};

TEST_P(NestedNl, IsSolvedOrRefusedButNeverOverrunsTheStack) {
  for (const int stack : {256, 512, 1024, 0}) {
    for (const int depth : {50, 150, 200, 500, 1200, 9'990, 100'000}) {
      const Result result =
          run_with_stack(stack, "solve --local --quiet --option time_limit_s=10 " + nested(depth));
      const bool refused = result.err.find("must be nested at most ") != std::string::npos;
      if (refused) {
        EXPECT_EQ(result.exit_code, 2) << result.err;
        EXPECT_GT(depth, stack == 0 ? 5000 : stack / 2) << stack << " kB";
      } else {
        EXPECT_TRUE(result.exit_code >= 0 && result.exit_code <= 2)
            << stack << " kB, " << depth << ": " << result.exit_code;
        EXPECT_LT(depth, 100'000) << result.out << result.err;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, NestedNl,
    ::testing::Values(
        Nest{"negations", [](NlWriter& nl) { nl.operation(16); }},
        Nest{"sines", [](NlWriter& nl) { nl.operation(41); }},
        Nest{"sums_to_the_right", [](NlWriter& nl) { nl.operation(0).variable(0); }},
        Nest{"sums_to_the_left", [](NlWriter& nl) { nl.operation(0); },
             [](NlWriter& nl) { nl.constant(1.0); }},
        Nest{"sums_of_three", [](NlWriter& nl) { nl.operation(54).integer(3).variable(0).variable(0); }},
        Nest{"products", [](NlWriter& nl) { nl.operation(2).constant(1.0); }},
        Nest{"products_of_variables", [](NlWriter& nl) { nl.operation(2).variable(0); }},
        Nest{"powers", [](NlWriter& nl) { nl.operation(5); }, [](NlWriter& nl) { nl.constant(1.0); }},
        Nest{"quotients", [](NlWriter& nl) { nl.operation(3); }, [](NlWriter& nl) { nl.constant(1.0); }},
        Nest{"minima", [](NlWriter& nl) { nl.operation(11).integer(2).variable(0); }},
        Nest{"branches",
             [](NlWriter& nl) { nl.operation(35).operation(22).variable(0).constant(1.0).variable(0); }},
        Nest{"angles", [](NlWriter& nl) { nl.operation(48).variable(0); }}),
    [](const auto& kind) { return std::string(kind.param.name); });

// Names in files, of files and of jobs that hold control and bidirectional characters: none of them reaches a
// terminal or a log, whichever command shows them.

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
