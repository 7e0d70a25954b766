#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>

#include "arguments/server_arguments.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "marble/contract.h"
#include "marble/convert.h"
#include "output/json.h"
#include "output/text_table.h"
#include "replay/bundle_file.h"
#include "replay/difference.h"
#include "replay/solve_request.h"

namespace marble::cli {
namespace {

struct ReplayArguments {
  std::string bundle;
  ServerArguments server;
};

/// The recorded values of a comparison.
struct Recorded {
  Bundle bundle;
  v1::SolveRequest request;
  v1::SolveResponse answer;
  Options options;
  [[nodiscard]] bool has_answer() const { return !bundle.answer.empty(); }
  [[nodiscard]] const v1::JobInfo& job() const { return bundle.facts.job().job(); }
  /// A clock or a person ended it; its iterations are still comparable.
  [[nodiscard]] bool was_cut_off() const {
    const auto status = answer.solution().status();
    return has_answer() && (status == v1::STATUS_TIME_LIMIT || status == v1::STATUS_CANCELLED ||
                            answer.solution().scenarios().end() == v1::SCENARIO_END_TIME_LIMIT ||
                            answer.solution().scenarios().end() == v1::SCENARIO_END_CANCELLED);
  }
  [[nodiscard]] bool has_error() const { return !has_answer() && job().has_error(); }
};

struct Outcome {
  std::vector<Difference> differences;
  std::vector<std::string> left_out;  // what was not compared, and why
};

Expected<Recorded> read_recorded(const std::string& path) {
  MARBLE_ASSIGN_OR_RETURN(auto bundle, load_bundle(path));
  Recorded recorded{std::move(bundle), {}, {}, {}};
  if (!recorded.request.ParseFromString(recorded.bundle.request))
    return unexpected(
        failure(ErrorCode::invalid_argument, "is no bundle: request.pb is no marble.v1.SolveRequest"));
  if (!recorded.answer.ParseFromString(recorded.bundle.answer))
    return unexpected(
        failure(ErrorCode::invalid_argument, "is no bundle: answer.pb is no marble.v1.SolveResponse"));
  const v1::GetJobResponse& job = recorded.bundle.facts.job();
  const v1::Solution& solution = recorded.answer.solution();
  // As used, including the server's defaults; if the server no longer has the job, its solution has them.
  MARBLE_ASSIGN_OR_RETURN(recorded.options,
                          options_of(job.has_options()        ? job.options()
                                     : solution.has_options() ? solution.options()
                                                              : recorded.request.options()));
  return recorded;
}

std::vector<v1::Progress> messages_of(const std::vector<Progress>& rows) {
  std::vector<v1::Progress> messages(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) to_message(rows[i], &messages[i]);
  return messages;
}

// Both runs failed: equal if their errors have the same code. The texts are the server's or the library's.
void compare_errors(const Recorded& recorded, const std::optional<Error>& now, Outcome& outcome) {
  const ErrorCode code = error_code_of(recorded.job().error().code());
  if (code == ErrorCode::cancelled || code == ErrorCode::deadline_exceeded ||
      code == ErrorCode::unavailable) {
    outcome.left_out.push_back(std::string("the answer: the job ended with ") + to_string(code));
  } else if (!now || now->code != code) {
    outcome.differences.push_back(
        {.field = "error",
         .before = to_string(code) + (": " + recorded.job().error().message()),
         .now = now ? to_string(now->code) + (": " + now->message()) : "an answer"});
  }
}

Expected<Outcome> compare(const Recorded& recorded, const Expected<Solved>& solved) {
  Outcome outcome;
  if (recorded.has_error()) {
    compare_errors(recorded, solved ? std::nullopt : std::optional(solved.error()), outcome);
  } else if (!solved) {
    return unexpected(solved.error());
  }
  if (!solved) return outcome;
  const v1::Trace& trace = recorded.bundle.facts.job().trace();
  const bool whole = recorded.has_answer() && !recorded.was_cut_off();
  if (trace.rows_size() == 0 && !solved->rows.empty()) {
    outcome.left_out.push_back("the convergence: none was kept");
  } else if (!solved->all_rows) {
    outcome.left_out.push_back("the convergence: the server reported it faster than it could be read");
  } else {
    outcome.differences = differences(trace, whole, messages_of(solved->rows));
  }
  if (recorded.was_cut_off()) {
    outcome.left_out.push_back("the answer: it was cut off, by a limit on time or by its end");
  } else if (recorded.has_answer()) {
    const auto of_answer = differences(recorded.answer.solution(), solved->solution);
    outcome.differences.insert(outcome.differences.end(), of_answer.begin(), of_answer.end());
  } else if (!recorded.has_error()) {
    outcome.left_out.push_back("the answer: there was none yet");
  }
  return outcome;
}

// Returns the earliest different row of the convergence, else the first field.
const Difference& first_of(const std::vector<Difference>& differences) {
  const auto rank = [](const Difference& one) {
    return one.field.starts_with("trace.") ? one.index : std::int64_t{1} << 40;
  };
  return *std::ranges::min_element(differences, {}, rank);
}

std::string place_of(const Difference& one) {
  std::string text = one.field;
  if (one.index >= 0) text += "[" + std::to_string(one.index) + "]";
  return text;
}

std::string reported(const Difference& one) {
  std::string text = place_of(one) + " was " + terminal_text(one.before) + ", is " + terminal_text(one.now);
  char more[96] = "";
  if (one.entries > 1)
    std::snprintf(more, sizeof more, "; %lld differ, by %.1e at most", static_cast<long long>(one.entries),
                  one.largest);
  return text + more;
}

std::string built(const v1::JobBundle& facts) {
  return terminal_text(facts.version() + ", " + facts.build() + ", " + facts.cpu());
}

void print(const Recorded& recorded, const v1::JobBundle& here, bool remote, const Outcome& outcome) {
  std::printf("then         %s\n", built(recorded.bundle.facts).c_str());
  if (!remote) std::printf("now          %s\n", built(here).c_str());
  for (const std::string& what : outcome.left_out)
    std::printf("not compared %s\n", terminal_text(what).c_str());
  if (outcome.differences.empty()) {
    std::printf("same         bit for bit, but for times\n");
    return;
  }
  std::printf("first        %s\n", reported(first_of(outcome.differences)).c_str());
  for (const Difference& one : outcome.differences) std::printf("differs      %s\n", reported(one).c_str());
}

Json json_of(const Difference& one) {
  return {{"field", one.field}, {"index", one.index},     {"then", one.before},
          {"now", one.now},     {"entries", one.entries}, {"largest", one.largest}};
}

void print_json(const ReplayArguments& arguments, const Recorded& recorded, const Outcome& outcome) {
  Json json = {{"file", arguments.bundle},
               {"same", outcome.differences.empty()},
               {"version", recorded.bundle.facts.version()},
               {"build", recorded.bundle.facts.build()},
               {"cpu", recorded.bundle.facts.cpu()},
               {"not_compared", outcome.left_out},
               {"differences", Json::array()}};
  if (!outcome.differences.empty()) json["first"] = json_of(first_of(outcome.differences));
  for (const Difference& one : outcome.differences) json["differences"].push_back(json_of(one));
  std::cout << line(json) << '\n';
}

int run(const ReplayArguments& arguments) {
  const auto fails = [&](const Error& error, int code) {
    complain(arguments.bundle, error.message());
    if (arguments.server.json())
      std::cout << line({{"file", arguments.bundle}, {"error", to_json(error)}}) << '\n';
    return code;
  };
  const auto recorded = read_recorded(arguments.bundle);
  if (!recorded) return fails(recorded.error(), kBadInput);
  const bool remote = arguments.server.server != contract::local_address;
  const auto client = connect(arguments.server);
  if (!client) return server_fails(arguments.server, client.error());
  const Interrupt interrupt;
  const auto outcome =
      compare(*recorded, solve_request(*client, recorded->request, recorded->options, interrupt.token()));
  if (!outcome)
    return fails(outcome.error(),
                 remote ? exit_code_of(outcome.error()) : exit_code_of_local(outcome.error()));
  v1::JobBundle here;
  report_build(&here);
  if (arguments.server.json()) {
    print_json(arguments, *recorded, *outcome);
  } else {
    print(*recorded, here, remote, *outcome);
  }
  return outcome->differences.empty() ? kAllSolved : kNotSolved;
}

}  // namespace

void add_replay(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<ReplayArguments>();
  arguments->server.server = contract::local_address;
  CLI::App* command = program.add_subcommand(
      "replay", "Solve a bundle again, locally or on a server, and compare the results bit by bit");
  command->add_option("BUNDLE", arguments->bundle, "bundle file written by job --bundle or solve --bundle")
      ->required();
  add_server_arguments(*command, arguments->server);
  command->footer(
      "Without --server the bundle is solved in this process. The command compares iterations, status, "
      "solution and\nmultipliers, but no times. If a time limit or a cancel ended the recorded solve, it "
      "compares iterations only. Another\nversion or processor may round differently; the command reports "
      "both.\n"
      "Exit codes: 0 identical, 1 different, 2 wrong usage or no bundle, 3 server unreachable or request "
      "refused.");
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
