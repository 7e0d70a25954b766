// What tests of replay bundles share: servers, the program, and bundles as they lie in files.
#pragma once

#include "bundle.h"
#include "cli_test.h"
#include "service/fleet_node.h"
#include "tar_zst.h"

namespace marble::testing {

class Replay : public Cli {
 protected:
  Result job(Node& node, const std::string& id, const std::string& arguments,
             const std::vector<std::string>& environment = {}) {
    return run("job " + id + " --server " + node.server().address() + " " + arguments, "/dev/null",
               environment);
  }
  std::string bundle_path() { return directory_.file("bundle " + std::to_string(++bundles_) + ".tar.zst"); }
  /// Of a job, as the program writes it.
  std::string bundle_of(Node& node, const std::string& id) {
    const std::string path = bundle_path();
    const Result written = job(node, id, "--bundle " + quoted(path));
    EXPECT_EQ(written.exit_code, 0) << written.err;
    return path;
  }
  /// Waits for its answer.
  static void finish(Node& node, const std::string& id) {
    v1::SolveResponse response;
    EXPECT_TRUE(node.result(id, true, &response).ok());
  }
  Result replay(const std::string& path, const std::string& arguments = "") {
    return run("replay " + quoted(path) + " " + arguments);
  }
  void expect_same(const std::string& path, const std::string& what = "") {
    const Result again = replay(path, "--output json");
    EXPECT_EQ(again.exit_code, 0) << what << ": " << again.out << again.err;
    ASSERT_EQ(again.lines().size(), 1U);
    EXPECT_EQ(again.lines()[0]["same"], true) << what;
    EXPECT_TRUE(again.lines()[0]["not_compared"].empty()) << what << again.out;
  }
  static Bundle read(const std::string& path) {
    auto bundle = read_bundle(read_file(path));
    EXPECT_TRUE(bundle) << bundle.error().message();
    return bundle ? *std::move(bundle) : Bundle();
  }
  /// Every file in it, with its name.
  static Expected<void> read_parts(const std::string& file,
                                   const std::function<void(std::string_view, std::string)>& take) {
    constexpr std::uint64_t kMost = 1 << 30;
    return read_tar_zst(
        file, kMost, [](std::string_view, std::uint64_t) -> Expected<TarTake> { return TarTake::keep; },
        take);
  }
  std::string write(const Bundle& bundle) {
    const std::string path = bundle_path();
    std::ofstream file(path, std::ios::binary);
    EXPECT_TRUE(write_bundle(bundle, [&](std::string_view bytes) -> Expected<void> {
      file << bytes;
      return {};
    }));
    return path;
  }

  int bundles_ = 0;
};

}  // namespace marble::testing
