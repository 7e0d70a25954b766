// A real Prometheus for one test, asked through its HTTP API.
#pragma once

#include <httplib.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "support/child_process.h"
#include "support/loopback.h"

namespace marble::testing {

class PrometheusProcess {
 public:
  /// Scrapes the server at `target` (HOST:PORT) twice a second, with the token, and evaluates the rules.
  PrometheusProcess(const std::string& target, const std::string& token, const std::string& rules)
      : address_("127.0.0.1:" + std::to_string(free_port())),
        process_({MARBLE_PROMETHEUS_BINARY, "--config.file=" + write_configuration(target, token, rules),
                  "--storage.tsdb.path=" + directory_.file("data"), "--web.listen-address=" + address_,
                  "--log.level=warn"},
                 directory_.file("log")) {
    const bool ready = eventually([&] {
      const auto answer = client().Get("/-/ready");
      return !process_.running() || (answer && answer->status == 200);
    });
    if (!ready || !process_.running())
      throw std::runtime_error("Prometheus did not start: " + process_.output());
  }

  /// The answer of /api/v1/PATH; its "status" says whether it is one.
  [[nodiscard]] nlohmann::json get(const std::string& path, const httplib::Params& parameters = {}) {
    const auto answer = client().Get("/api/v1/" + path, parameters, httplib::Headers{});
    return answer ? nlohmann::json::parse(answer->body) : nlohmann::json{{"status", "no answer"}};
  }
  [[nodiscard]] nlohmann::json query(const std::string& expression) {
    return get("query", {{"query", expression}});
  }
  /// The value of a query with one sample; NaN if it has none or several.
  [[nodiscard]] double value(const std::string& expression) {
    const nlohmann::json answer = query(expression);
    if (answer.at("status") != "success" || answer.at("data").at("result").size() != 1) return std::nan("");
    return std::stod(answer.at("data").at("result")[0].at("value")[1].get<std::string>());
  }

 private:
  [[nodiscard]] httplib::Client client() const { return httplib::Client("http://" + address_); }

  [[nodiscard]] std::string write_configuration(const std::string& target, const std::string& token,
                                                const std::string& rules) const {
    std::string path = directory_.file("prometheus.yml");
    std::ofstream(path)
        << "global: {scrape_interval: 500ms, scrape_timeout: 500ms, evaluation_interval: 500ms}\n"
        << "rule_files: [\"" << rules << "\"]\n"
        << "scrape_configs:\n- job_name: marble\n"
        << "  authorization: {credentials: \"" << token << "\"}\n"
        << "  static_configs: [{targets: [\"" << target << "\"]}]\n";
    return path;
  }

  TemporaryDirectory directory_;
  std::string address_;
  ChildProcess process_;
};

}  // namespace marble::testing
