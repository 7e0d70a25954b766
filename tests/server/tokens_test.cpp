#include "base/tokens.h"

#include <gtest/gtest.h>

namespace marble::server {
namespace {

// SHA-256 of the bytes 00ff and "secret", by the sha256sum command.
constexpr const char* kLine =
    "planner solve,observe sha256:00ff:"
    "ef0e761eb7b7bc46acd2d38ed243b441f7cc14b46502968e5175808376b60895";

std::vector<int> faulty_lines(const std::string& text) {
  std::vector<LineFault> faults;
  static_cast<void>(parse_tokens(text, faults));
  std::vector<int> lines;
  lines.reserve(faults.size());
  for (const LineFault& fault : faults) lines.push_back(fault.line);
  return lines;
}

TEST(Tokens, AHashMadeByOthersIsUnderstood) {
  std::vector<LineFault> faults;
  const auto tokens = parse_tokens(std::string("# people\n\n  ") + kLine + "\r\n", faults);
  EXPECT_TRUE(faults.empty());
  ASSERT_EQ(tokens.size(), 1U);
  EXPECT_EQ(tokens[0].client, "planner");
  EXPECT_EQ(tokens[0].roles, Roles({Role::solve, Role::observe}));
  EXPECT_EQ(find_token(tokens, "secret"), tokens.data());
  EXPECT_EQ(find_token(tokens, "Secret"), nullptr);
  EXPECT_EQ(find_token(tokens, ""), nullptr);
}

TEST(Tokens, ANewOneIsFoundAmongOthersAndOnlyByItsSecret) {
  const auto first = new_token("first:solve"), second = new_token("second:admin,solve");
  ASSERT_TRUE(first && second);
  EXPECT_NE(first->secret, second->secret);
  EXPECT_EQ(first->secret.size(), 64U);
  EXPECT_EQ(first->line.find(first->secret), std::string::npos);
  std::vector<LineFault> faults;
  const auto tokens = parse_tokens(first->line + "\n" + second->line, faults);
  ASSERT_EQ(tokens.size(), 2U);
  EXPECT_EQ(find_token(tokens, first->secret)->client, "first");
  EXPECT_EQ(find_token(tokens, second->secret)->client, "second");
  EXPECT_EQ(find_token(tokens, second->secret)->roles, Roles({Role::admin, Role::solve}));
  EXPECT_EQ(find_token({}, first->secret), nullptr);
}

TEST(Tokens, EveryFaultyLineIsReported) {
  const std::string good = kLine;
  const std::string hash = good.substr(good.rfind(' ') + 1);
  EXPECT_EQ(faulty_lines(good + "\n" +                      //
                         "planner solve\n" +                // no hash
                         good + " more\n" +                 //
                         "planner root " + hash + "\n" +    //
                         "planner solve, " + hash + "\n" +  // a comma too many is no role, and no harm
                         "planner ,solve " + hash + "\n" +  //
                         "planner solve md5:00:00\n" +      //
                         "planner solve sha256::" + hash.substr(hash.rfind(':') + 1) + "\n" +  // no salt
                         good.substr(0, good.size() - 1) + "\n" +                              //
                         good.substr(0, good.size() - 1) + "g\n" +                             //
                         std::string(65, 'x') + " solve " + hash + "\n" +                      //
                         "pl\xc3\xa4ner solve " + hash + "\n"),
            (std::vector<int>{2, 3, 4, 6, 7, 8, 9, 10, 11, 12}));
}

TEST(Tokens, FaultsQuoteNothing) {
  std::vector<LineFault> faults;
  static_cast<void>(parse_tokens("hush hush hush\nx hush sha256:hush:hush\n", faults));
  ASSERT_EQ(faults.size(), 2U);
  for (const LineFault& fault : faults)
    EXPECT_EQ(fault.error.message().find("hush"), std::string::npos) << fault.error.message();
}

}  // namespace
}  // namespace marble::server
