// Files that nest deeply: within the stack that there is they are read and solved, beyond it they are refused
// in words.
#include "cli_test.h"
#include "formats/nl_writer.h"

namespace marble::testing {
namespace {

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

}  // namespace
}  // namespace marble::testing
