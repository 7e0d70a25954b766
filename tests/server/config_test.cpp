#include "config/config.h"

#include <gtest/gtest.h>

#include "support/child_process.h"

namespace marble::server {
namespace {

class Config : public ::testing::Test {
 protected:
  using Loaded = tl::expected<server::Config, std::vector<ConfigFault>>;

  /// A variable of the environment for one test.
  void set_variable(const std::string& name, const std::string& value) {
    setenv(name.c_str(), value.c_str(), 1);
    variables_.push_back(name);
  }
  ~Config() override {
    for (const std::string& name : variables_) unsetenv(name.c_str());
  }

  static Loaded load(const std::vector<std::string>& flags) {
    std::vector<const char*> argv = {"marble-server"};
    for (const std::string& flag : flags) argv.push_back(flag.c_str());
    int exit_code = 0;
    const auto command_line = parse_command_line(static_cast<int>(argv.size()), argv.data(), exit_code);
    EXPECT_TRUE(command_line.has_value());
    return load_config(*command_line);
  }
  Loaded load_file(const std::string& content, std::vector<std::string> flags = {}) {
    std::ofstream(file_) << content;
    flags.insert(flags.end(), {"--config", file_});
    return load(flags);
  }
  /// What is wrong with a file, without the file's own path.
  std::vector<std::string> faults(const std::string& content) {
    std::vector<std::string> result;
    const auto config = load_file(content);
    if (config) return result;
    for (const ConfigFault& fault : config.error()) {
      const std::string message = fault.message();
      EXPECT_EQ(message.rfind(file_ + ":", 0), 0U) << message;
      result.push_back(message.substr(file_.size() + 1));
    }
    return result;
  }

  testing::TemporaryDirectory directory_;
  const std::string file_ = directory_.file("marble.toml");

 private:
  std::vector<std::string> variables_;
};

TEST_F(Config, LoopbackAndUnixSocketsAreLocal) {
  for (const char* address : {"127.0.0.1:50051", "127.1.2.3:0", "[::1]:50051", "localhost:1",
                              "unix:/run/marble.sock", "unix-abstract:marble"}) {
    EXPECT_TRUE(is_local_address(address)) << address;
  }
}

TEST_F(Config, EverythingElseIsNot) {
  for (const char* address :
       {"0.0.0.0:50051", "[::]:50051", "10.0.0.1:1", "example.org:1", "127.0.0.1.example.org:1",
        "localhost.example.org:1", "dns:///localhost:1", "unixes.example.org:1", ":50051", ""}) {
    EXPECT_FALSE(is_local_address(address)) << address;
  }
}

TEST_F(Config, AFlagWinsOverTheEnvironmentThatOverTheFileAndAllOverTheDefault) {
  set_variable("MARBLE_QUEUE_JOBS", "7");
  set_variable("MARBLE_WORKERS", "5");
  const auto config = load_file("workers = 1\nqueue_jobs = 2\n\nsessions = 4\n", {"--workers", "3"});
  ASSERT_TRUE(config.has_value()) << config.error()[0].message();
  EXPECT_EQ(config->workers, 3);
  EXPECT_EQ(config->queue_jobs, 7);
  EXPECT_EQ(config->sessions, 4);
  EXPECT_EQ(config->message_bytes, Settings().message_bytes);
  EXPECT_EQ(source_of(*config, "workers"), "flag --workers");
  EXPECT_EQ(source_of(*config, "queue_jobs"), "environment MARBLE_QUEUE_JOBS");
  EXPECT_EQ(source_of(*config, "sessions"), file_ + ":4");
  EXPECT_EQ(source_of(*config, "message_bytes"), "default");
}

TEST_F(Config, TheEnvironmentMayNameTheFile) {
  std::ofstream(file_) << "workers = 9\n";
  set_variable("MARBLE_CONFIG", file_);
  EXPECT_EQ(load({})->workers, 9);
}

TEST_F(Config, ReadsEveryTable) {
  const auto config = load_file(
      "listen = [\"127.0.0.1:1\", \"unix:socket\"]\n"
      "drain_grace_s = 5\n"
      "[solver]\n"
      "path = \"paper\"\nkappa_factor = 0.25\nmax_iterations = 7\npolish = false\n"
      "[clients.planner]\n"
      "running = 2\nbytes = 1000\npriority = \"interactive\"\nroles = [\"admin\", \"observe\"]\n");
  ASSERT_TRUE(config.has_value()) << config.error()[0].message();
  EXPECT_EQ(config->listen, (std::vector<std::string>{"127.0.0.1:1", "unix:socket"}));
  EXPECT_EQ(config->drain_grace_s, 5.0) << "a whole number will do";
  EXPECT_EQ(config->solver_defaults.path, Path::paper);
  EXPECT_EQ(config->solver_defaults.kappa_factor, 0.25);
  EXPECT_EQ(config->solver_defaults.max_iterations, 7);
  EXPECT_FALSE(config->solver_defaults.polish);
  const ClientConfig& planner = config->clients.at("planner");
  EXPECT_EQ(planner.settings.at("client_running"), SettingValue(std::int64_t{2}));
  EXPECT_EQ(planner.settings.count("client_queued"), 0U);
  EXPECT_EQ(planner.roles, Roles({Role::admin, Role::observe}));
}

TEST_F(Config, ListenMayBeOneText) {
  EXPECT_EQ(load_file("listen = \"127.0.0.1:7\"\n")->listen, std::vector<std::string>{"127.0.0.1:7"});
}

TEST_F(Config, ReportsEveryFaultWithItsLineAndKey) {
  const std::vector<std::string> expected = {
      "1: workers = 5000: must be in [0, 1024]",
      "2: queue_jobz: is not a setting",
      "3: drain_grace_s = soon: must be a number",
      "4: queue_jobs = 1.5: must be a whole number",
      "5: insecure = 1: must be true or false",
      "6: log_level = shout: must be one of debug, info, warn, error, off",
      "7: keepalive_s = nan: must be in [1.0, 86400.0]",
      "8: sessions: must be a text, a number, true or false",
      "10: solver.path = slow: must be one of fast, paper, algorithm1",
      "11: solver.kappa_min = 2: must be in [1e-20, 1]",
      "12: solver.polish = 1: must be true or false",
      "13: solver.nonsense: is not an option",
      "14: solver.method = alag: must be marble; `marble compare` and `marble reproduce` run the others",
      "16: clients.a b.running = -1: must be in [0, 1000000]",
      "17: clients.a b.speed: is not a setting",
      "18: clients.a b.roles = root: must be solve, observe or admin"};
  EXPECT_EQ(faults("workers = 5000\n"
                   "queue_jobz = 1\n"
                   "drain_grace_s = \"soon\"\n"
                   "queue_jobs = 1.5\n"
                   "insecure = 1\n"
                   "log_level = \"shout\"\n"
                   "keepalive_s = nan\n"
                   "sessions = [1]\n"
                   "[solver]\n"
                   "path = \"slow\"\n"
                   "kappa_min = 2.0\n"
                   "polish = 1\n"
                   "nonsense = 1\n"
                   "method = \"alag\"\n"
                   "[clients.\"a b\"]\n"
                   "running = -1\n"
                   "speed = 1\n"
                   "roles = [\"root\"]\n"),
            expected);
}

TEST_F(Config, ReportsWhatIsNoToml) {
  EXPECT_EQ(faults("workers = 1\nworkers = 2\n").size(), 1U);
  EXPECT_EQ(faults("workers = 1\n\nworkers 2\n").at(0).rfind("3: ", 0), 0U);
  EXPECT_EQ(faults("solver = 1\n"), std::vector<std::string>{"1: solver: must be a table"});
  EXPECT_EQ(faults("clients.a = 1\n"), std::vector<std::string>{"1: clients.a: must be a table"});
  EXPECT_EQ(faults("listen = [\"127.0.0.1:1\", 2]\n"),
            std::vector<std::string>{"1: listen: must be a text or an array of texts"});
}

TEST_F(Config, FaultsOfTheOtherSourcesSayWhere) {
  set_variable("MARBLE_WORKERS", "many");
  const auto config = load({"--queue-jobs", "-1", "--listen", "0.0.0.0:1", "--config", "no-such-file"});
  ASSERT_FALSE(config.has_value());
  std::vector<std::string> where;
  for (const ConfigFault& fault : config.error()) where.push_back(fault.where);
  EXPECT_EQ(where, (std::vector<std::string>{"no-such-file", "environment MARBLE_WORKERS",
                                             "flag --queue-jobs", "flag --listen", "flag --listen"}));
}

TEST_F(Config, PrintedItReadsBackAsTheSame) {
  set_variable("MARBLE_SESSIONS", "4");
  const auto config = load_file(
      "listen = [\"127.0.0.1:1\", \"unix:a \\\"b\\\" \\\\c\"]\n"
      "workers = 3\nresult_keep_s = 0.1\nqueue_bytes = 1099511627776\n"
      "[solver]\npath = \"paper\"\ninner_tolerance = 0.30000000000000004\n"
      "[clients.\"x.y z\"]\npriority = \"batch\"\nroles = [\"solve\"]\n[clients.empty]\n",
      {"--insecure"});
  ASSERT_TRUE(config.has_value()) << config.error()[0].message();
  const std::string printed = to_toml(*config);
  EXPECT_NE(printed.find("workers = 3  # " + file_ + ":2\n"), std::string::npos) << printed;
  EXPECT_NE(printed.find("sessions = 4  # environment MARBLE_SESSIONS\n"), std::string::npos) << printed;
  EXPECT_NE(printed.find("insecure = true  # flag --insecure\n"), std::string::npos) << printed;
  EXPECT_NE(printed.find("queue_jobs = 1024  # default\n"), std::string::npos) << printed;
  unsetenv("MARBLE_SESSIONS");
  const auto again = load_file(printed);
  ASSERT_TRUE(again.has_value()) << again.error()[0].message();
  EXPECT_EQ(again->listen, config->listen);
  EXPECT_EQ(again->clients, config->clients);
  for (const SettingInfo& setting : setting_table())
    EXPECT_EQ(get_setting(*again, setting.name), get_setting(*config, setting.name)) << setting.name;
  for (const OptionInfo& option : option_table()) {
    EXPECT_EQ(get_option(again->solver_defaults, option.name),
              get_option(config->solver_defaults, option.name))
        << option.name;
  }
}

TEST_F(Config, ThePublicUrlIsOneOfAWebServer) {
  const auto config = load({"--public-url", "https://solver-1.example:8443"});
  ASSERT_TRUE(config.has_value()) << config.error()[0].message();
  EXPECT_EQ(config->public_url, "https://solver-1.example:8443");
  for (const std::string url :
       {"solver-1", "http://", "https://user:secret@host", "http://host/page", "ftp://host",
        "javascript:alert(1)", "http://host\\\" onclick=x", "http://a b"}) {
    const auto wrong = faults("public_url = \"" + url + "\"\n");
    ASSERT_EQ(wrong.size(), 1U) << url;
    EXPECT_EQ(wrong[0].rfind("1: public_url", 0), 0U) << wrong[0];
    EXPECT_NE(wrong[0].find("without user and path, of at most 256 characters"), std::string::npos)
        << wrong[0];
  }
}

TEST_F(Config, EverySettingsDefaultIsInItsRange) {
  Settings settings;
  for (const SettingInfo& setting : setting_table())
    EXPECT_TRUE(set_setting(settings, setting.name, setting.default_value).has_value()) << setting.name;
}

}  // namespace
}  // namespace marble::server
