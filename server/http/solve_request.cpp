#include "http/solve_request.h"

#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/type_resolver_util.h>

#include <vector>

#include "base/wire.h"
#include "marble/convert.h"
#include "marble/json_problem.h"

namespace marble::server::http {
namespace {

constexpr std::size_t kMostShown = 200;  // characters of a client's text
const std::string kTypes = "type.googleapis.com/";

// The members beside the problem.
const std::vector<std::string_view>& other_members() {
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> all;
    const auto& fields = *v1::SolveRequest::descriptor();
    for (int k = 0; k < fields.field_count(); ++k) {
      if (fields.field(k)->name() != "problem") all.push_back(fields.field(k)->name());
    }
    return all;
  }();
  return names;
}

// Protobuf writes "(place): invalid value …", "(place) name: what is wrong with it", or only the latter.
Error fault_of(std::string text) {
  std::string field;
  const auto cut = [&text](std::size_t from, std::size_t size) {
    std::string part = text.substr(from, size);
    text.erase(0, std::min(text.size(), text.find_first_not_of(": ", from + size + 1)));
    return part;
  };
  if (const std::size_t end = text.find(')'); text.starts_with('(') && end != std::string::npos)
    field = cut(1, end - 1);
  if (const std::size_t end = text.find(": "); end < text.find_first_of(" \""))
    field += (field.empty() ? "" : ".") + cut(0, end);
  for (std::size_t at = text.find(kTypes); at != std::string::npos; at = text.find(kTypes, at))
    text.erase(at, kTypes.size());
  return invalid(field.substr(0, kMostShown),
                 "is not as the API describes it: " + text.substr(0, kMostShown));
}

// Through bytes: there a limit on the number of fields applies before any is created.
Expected<void> read_rest(const std::string& rest, v1::SolveRequest* message) {
  static google::protobuf::util::TypeResolver* const types =
      google::protobuf::util::NewTypeResolverForDescriptorPool(
          "type.googleapis.com", google::protobuf::DescriptorPool::generated_pool());
  std::string bytes;
  const auto read = google::protobuf::util::JsonToBinaryString(
      types, kTypes + message->GetDescriptor()->full_name(), rest, &bytes);
  if (!read.ok()) return unexpected(fault_of(std::string(read.message())));
  const grpc::Slice slice(bytes);
  const grpc::ByteBuffer buffer(&slice, 1);
  return parse(&buffer, message);
}

}  // namespace

Expected<std::shared_ptr<v1::SolveRequest>> solve_request_of(std::string_view text, std::int64_t most_bytes) {
  MARBLE_ASSIGN_OR_RETURN(auto read, parse_json_request(text, other_members()));
  auto message = std::make_shared<v1::SolveRequest>();
  MARBLE_RETURN_IF_ERROR(read_rest(read.rest, message.get()));
  if (read.problem) {
    const OwnedProblem& problem = read.problem->problem;
    if (!problem.initial_z.empty() && message->has_initial_point())
      return unexpected(invalid("initial_point", "must not be there beside x0 of the problem"));
    to_message(problem.view(), message->mutable_problem());
    message->mutable_problem()->set_name(problem.name);
    if (!problem.initial_z.empty())
      message->mutable_initial_point()->mutable_z()->Assign(problem.initial_z.begin(),
                                                            problem.initial_z.end());
  } else if (!message->has_coupled()) {
    return unexpected(invalid("problem", "is missing"));
  }
  const auto bytes = static_cast<std::int64_t>(message->ByteSizeLong());
  if (bytes <= most_bytes) return message;
  return unexpected(failure(ErrorCode::resource_exhausted, "message_bytes", std::to_string(bytes) + " bytes",
                            "a request must have at most " + std::to_string(most_bytes) + " as a message"));
}

}  // namespace marble::server::http
