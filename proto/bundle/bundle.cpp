#include "bundle.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/wire_format_lite.h>

#include <fstream>
#include <limits>
#include <map>

#include "marble/convert.h"
#include "marble/v1/service.pb.h"
#include "marble/version.h"
#include "marble/wire_fields.h"
#include "message_json.h"
#include "problem_json.h"
#include "tar_zst.h"

extern "C" char* openblas_get_corename() __attribute__((weak));  // only OpenBLAS has it

namespace marble {
namespace {

constexpr const char* kFactsFile = "job.pb";
constexpr const char* kRequestFile = "request.pb";
constexpr const char* kAnswerFile = "answer.pb";
constexpr std::size_t kMostText = 16 << 20;  // bytes of an answer that is written as text too
// Bytes that any file may unpack to, those passed over too: they cost time alone.
constexpr std::uint64_t kLeastUnpacked = 256 << 20;
// Bytes of the parts that are read, and of what they become, of any file.
constexpr std::uint64_t kLeastKept = 64 << 20;
constexpr std::uint64_t kMostRatio = 100;   // both: and this many times the file's
constexpr std::uint64_t kFieldBytes = 256;  // what a field may become when it is parsed

constexpr const char* kReadMe =
    "A solve by Marble, to be solved again: marble replay FILE reports what differs.\n"
    "\n"
    "bundle.json   version, processor, options and end\n"
    "problem.json  the problem, for marble solve (blocks of coupled problems are in request.pb alone)\n"
    "answer.json   the answer, where it is not too large\n"
    "trace.csv     the convergence, for marble plot\n"
    "job.pb, request.pb, answer.pb  what marble replay reads: marble.v1.JobBundle, SolveRequest, "
    "SolveResponse\n"
    "\n"
    "There is no token, name or address of who asked in it. The problem and its name are.\n";

Error damaged(const std::string& how) { return failure(ErrorCode::invalid_argument, "is no bundle: " + how); }

std::string json_of(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.preserve_proto_field_names = true;
  std::string json;
  (void)google::protobuf::util::MessageToJsonString(message, &json, options);
  return json;
}

std::string trace_csv(const v1::Trace& trace) {
  std::string text = progress_csv_header() + "\n";
  for (const v1::Progress& row : trace.rows()) {
    append_progress_csv(progress_of(row), text);
    text += '\n';
  }
  return text;
}

// The facts as text. A sampler's seed is reported here too; all else in Marble that is random is fixed.
std::string facts_json(const v1::JobBundle& facts) {
  v1::JobBundle reported = facts;
  reported.mutable_job()->clear_trace();
  return json_of(reported);
}

std::string last_part(std::string_view path) { return std::string(path.substr(path.find_last_of('/') + 1)); }

// Before any part is parsed: two bytes of it may become hundreds.
template <class Message>
Expected<void> check_part(const std::string& bytes, const char* file, std::uint64_t most_bytes) {
  if (bytes.size() > std::numeric_limits<int>::max())
    return unexpected(damaged(std::string(file) + " has more than 2 GiB"));
  google::protobuf::io::ArrayInputStream input(bytes.data(), static_cast<int>(bytes.size()));
  const auto valid =
      check_fields(input, *Message::descriptor(), static_cast<std::int64_t>(most_bytes / kFieldBytes));
  if (valid) return {};
  return unexpected(damaged(std::string(file) + ": " + valid.error().message() + ", in a file of this size"));
}

template <class Message>
Expected<void> parse(const std::string& bytes, const char* file, Message* message) {
  if (message->ParseFromString(bytes)) return {};
  return unexpected(damaged(std::string(file) + " is no " + Message::descriptor()->full_name()));
}

}  // namespace

void report_build(v1::JobBundle* facts) {
  facts->set_version(kVersion);
#if defined(__clang__)
  std::string build = __VERSION__;
#else
  std::string build = std::string("g++ ") + __VERSION__;
#endif
#if defined(__x86_64__)
  build += ", x86-64";
#elif defined(__aarch64__)
  build += ", arm64";
#endif
#ifndef NDEBUG
  build += ", assertions";
#endif
  facts->set_build(build);
  std::string cpu;
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; cpu.empty() && std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) cpu = line.substr(colon + 2);
  }
  if (cpu.empty()) cpu = "unknown";
  if (openblas_get_corename != nullptr) cpu += std::string(", OpenBLAS for ") + openblas_get_corename();
  facts->set_cpu(cpu);
}

void make_anonymous(v1::JobBundle* facts) {
  v1::JobInfo* job = facts->mutable_job()->mutable_job();
  job->clear_client();
  job->clear_request_id();
  job->clear_trace_id();
  job->clear_server();
}

void make_anonymous(std::string* request) {
  using google::protobuf::internal::WireFormatLite;
  std::string kept;
  bool found = false;
  {
    google::protobuf::io::ArrayInputStream bytes(request->data(), static_cast<int>(request->size()));
    google::protobuf::io::CodedInputStream input(&bytes);
    int copied = 0;
    while (true) {
      const int begin = input.CurrentPosition();
      const std::uint32_t tag = input.ReadTag();
      if (tag == 0 || !WireFormatLite::SkipField(&input, tag)) break;
      if (WireFormatLite::GetTagFieldNumber(tag) != v1::SolveRequest::kRequestIdFieldNumber) continue;
      found = true;
      kept.append(*request, static_cast<std::size_t>(copied), static_cast<std::size_t>(begin - copied));
      copied = input.CurrentPosition();
    }
    if (found) kept.append(*request, static_cast<std::size_t>(copied));
  }
  if (found) request->swap(kept);
}

Expected<void> write_bundle(const Bundle& bundle, const BundleSink& sink) {
  v1::SolveRequest request;
  MARBLE_RETURN_IF_ERROR(parse(bundle.request, kRequestFile, &request));
  v1::SolveResponse answer;
  MARBLE_RETURN_IF_ERROR(parse(bundle.answer, kAnswerFile, &answer));
  TarZstWriter archive(sink);
  const auto when = static_cast<std::int64_t>(bundle.facts.job().job().accepted_unix_s());
  Expected<void> written;
  const auto add = [&](const char* name, const std::string& content) {
    if (written)
      written = archive.add(name, content.size(), when,
                            [&](const TarZstWriter::Report& report) { return report(content); });
  };
  add("README.txt", kReadMe);
  add("bundle.json", facts_json(bundle.facts));
  add(kFactsFile, bundle.facts.SerializeAsString());
  add(kRequestFile, bundle.request);
  if (written && has_problem(request)) {
    std::uint64_t size = 0;
    (void)write_problem_json(request, [&](std::string_view text) -> Expected<void> {
      size += text.size();
      return {};
    });
    written = archive.add("problem.json", size, when, [&](const TarZstWriter::Report& report) {
      return write_problem_json(request, report);
    });
  }
  add("trace.csv", trace_csv(bundle.facts.job().trace()));
  if (!bundle.answer.empty()) add(kAnswerFile, bundle.answer);
  if (written && !bundle.answer.empty() && bundle.answer.size() <= kMostText) {
    written =
        archive.add("answer.json", message_json_size(answer), when, [&](const TarZstWriter::Report& report) {
          Expected<void> reported;
          write_message_json(answer, [&](std::string_view piece) {
            reported = report(piece);
            return reported.has_value();
          });
          return reported;
        });
  }
  return written ? archive.finish() : written;
}

Expected<Bundle> read_bundle(std::string_view file) {
  std::map<std::string, std::string> parts;
  const std::uint64_t most = kLeastKept + kMostRatio * file.size();
  std::uint64_t kept = 0;
  const auto ask = [&](std::string_view path, std::uint64_t size) -> Expected<TarTake> {
    const std::string name = last_part(path);
    if (name != kFactsFile && name != kRequestFile && name != kAnswerFile) return TarTake::skip;
    if (!parts.try_emplace(name).second) return unexpected(damaged(name + " is in it twice"));
    if (size > most - kept) {
      return unexpected(damaged(name + " has " + std::to_string(size) +
                                " bytes; a file of this size may have at most " + std::to_string(most) +
                                " in the parts that are read"));
    }
    kept += size;
    return TarTake::keep;
  };
  const auto take = [&](std::string_view path, std::string content) {
    parts[last_part(path)] = std::move(content);
  };
  MARBLE_RETURN_IF_ERROR(read_tar_zst(file, kLeastUnpacked + kMostRatio * file.size(), ask, take));
  for (const char* name : {kFactsFile, kRequestFile}) {
    if (!parts.contains(name)) return unexpected(damaged(std::string(name) + " is not in it"));
  }
  Bundle bundle{{}, std::move(parts[kRequestFile]), std::move(parts[kAnswerFile])};
  MARBLE_RETURN_IF_ERROR(check_part<v1::JobBundle>(parts[kFactsFile], kFactsFile, most));
  MARBLE_RETURN_IF_ERROR(check_part<v1::SolveRequest>(bundle.request, kRequestFile, most));
  MARBLE_RETURN_IF_ERROR(check_part<v1::SolveResponse>(bundle.answer, kAnswerFile, most));
  MARBLE_RETURN_IF_ERROR(parse(parts[kFactsFile], kFactsFile, &bundle.facts));
  const auto check = [](std::int64_t reported, const std::string& there, const char* name) -> Expected<void> {
    if (reported == static_cast<std::int64_t>(there.size())) return {};
    return unexpected(damaged(std::string(name) + " has " + std::to_string(there.size()) + " bytes, not " +
                              std::to_string(reported)));
  };
  MARBLE_RETURN_IF_ERROR(check(bundle.facts.request_bytes(), bundle.request, kRequestFile));
  MARBLE_RETURN_IF_ERROR(check(bundle.facts.answer_bytes(), bundle.answer, kAnswerFile));
  return bundle;
}

}  // namespace marble
