// What the tests of the command line share: they run the real program and look at its streams and exit code.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/server_process.h"

namespace marble::testing {

using Json = nlohmann::json;

class Cli : public ::testing::Test {
 protected:
  struct Result {
    int exit_code;
    std::string out, err;
    [[nodiscard]] std::vector<Json> lines() const {
      std::vector<Json> all;
      std::istringstream stream(out);
      for (std::string line; std::getline(stream, line);) all.push_back(Json::parse(line));
      return all;
    }
  };

  /// A running marble with its streams in files of their own.
  struct Run {
    std::string out, err;
    std::unique_ptr<ChildProcess> process;
    [[nodiscard]] Result wait() const {
      const int code = process->wait();
      return {code, read_file(out), read_file(err)};
    }
  };

  /// Starts marble by a shell that becomes it, so that the streams can be distinguished and standard input
  /// be given. `environment` holds "NAME=value"; `err` may name a terminal.
  Run start(const std::string& arguments, const std::string& input = "/dev/null",
            std::vector<std::string> environment = {}, std::string err = "") {
    const std::string out = directory_.file("out " + std::to_string(++runs_));
    if (err.empty()) err = directory_.file("err " + std::to_string(runs_));
    const std::string command = std::string("exec '") + MARBLE_BINARY + "' " + arguments + " <'" + input +
                                "' >'" + out + "' 2>'" + err + "'";
    return {out, err,
            std::make_unique<ChildProcess>(std::vector<std::string>{"/bin/sh", "-c", command},
                                           directory_.file("shell"), std::move(environment))};
  }
  Result run(const std::string& arguments, const std::string& input = "/dev/null",
             std::vector<std::string> environment = {}) {
    return start(arguments, input, std::move(environment)).wait();
  }
  std::string file(const std::string& name, const std::string& content) {
    const std::string path = directory_.file(name);
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }
  static std::string quoted(const std::string& path) { return "'" + path + "'"; }

  TemporaryDirectory directory_;
  int runs_ = 0;
};

// min z₁² + z₂² − 2z₁ + 1, 0 ≤ z₂ ⊥ z₂ − z₁ ≥ 0; optimum ½.
inline constexpr const char* kGood =
    R"({"n":2,"c0":1,"g":[-2,0],"Q":{"rows":2,"cols":2,"i":[0,1],"j":[0,1],"v":[2,2]},)"
    R"("L":{"rows":1,"cols":2,"i":[0],"j":[1],"v":[1]},"l":[0],)"
    R"("R":{"rows":1,"cols":2,"i":[0,0],"j":[0,1],"v":[-1,1]},"r":[0],"best_known_objective":0.5})";

// min z, z ≥ 2, z ≤ 1: no solver finds a point, whatever it calls the end.
inline constexpr const char* kUnsolvable =
    R"({"n":1,"g":[1],"C":{"rows":2,"cols":1,"i":[0,1],"j":[0,0],"v":[1,-1]},"d":[-2,1]})";

}  // namespace marble::testing
