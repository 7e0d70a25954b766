// Files that are no problems: what is wrong and where is said, and the server lives on.
#include "cli_test.h"

namespace marble::testing {
namespace {

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

}  // namespace
}  // namespace marble::testing
