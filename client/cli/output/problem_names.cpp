#include "output/problem_names.h"

#include <iostream>
#include <iterator>
#include <tuple>

#include "file_bytes.h"
#include "formats.h"
#include "nl/nl_problem.h"
#include "output/json.h"

namespace marble::cli {
namespace {

Expected<std::vector<std::string>> texts(const Json& names, const char* key, std::size_t count) {
  std::vector<std::string> result;
  const auto found = names.find(key);
  if (found == names.end() || found->is_null()) return result;
  const std::string field = std::string("names.") + key;
  if (!found->is_array() || found->size() != count)
    return unexpected(invalid(field, "must be an array of " + std::to_string(count) + " texts"));
  for (const Json& name : *found) {
    if (!name.is_string()) {
      return unexpected(
          invalid(field, static_cast<std::int64_t>(result.size()), name.dump(), "must be a text"));
    }
    result.push_back(name);
  }
  return result;
}

// Keeps only the member "names" of the text, so that memory is proportional to it; the other members may be
// nested to any depth. Null without it.
Expected<Json> names_member(const std::string& text) {
  bool inside = false, too_deep = false;
  const auto keep = [&](int depth, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::key && depth == 1) inside = parsed == "names";
    too_deep = too_deep || (inside && depth > kDeepestJson);
    return depth == 0 || (inside && !too_deep);
  };
  const Json document = Json::parse(text, keep, false);
  if (too_deep)
    return unexpected(invalid("names", "is nested too deep: must be an object of arrays of texts"));
  if (!document.is_object() || !document.contains("names")) return Json();
  return document["names"];
}

// A row or a bound of the file may be two rows of the problem, and a pair has a row and a variable.
ProblemNames nl_names(const formats::NlProblem& nl, const formats::NlNames& names) {
  const OwnedProblem& p = nl.file.problem;
  ProblemNames result;
  for (std::size_t j = 0; j < p.g.size(); ++j) result.variables.push_back(names.column(static_cast<int>(j)));
  result.equalities.resize(p.b.size());
  result.inequalities.resize(p.d.size());
  result.pairs.resize(p.l.size());
  const auto take = [&](const formats::DualTerm& term, const std::string& name) {
    const auto at = static_cast<std::size_t>(term.index);
    std::string& into = term.block == formats::Block::equality     ? result.equalities[at]
                        : term.block == formats::Block::inequality ? result.inequalities[at]
                                                                   : result.pairs[at];
    if (into.empty()) into = name;
  };
  for (const formats::DualTerm& term : nl.row_duals) take(term, names.row(term.of));
  for (const formats::DualTerm& term : nl.reduced_costs) take(term, "bound of " + names.column(term.of));
  return result;
}

Expected<NamedProblem> read_standard_input() {
  const std::string content(std::istreambuf_iterator<char>(std::cin), {});
  if (content.empty()) return unexpected(failure(ErrorCode::invalid_argument, "is empty"));
  const FileFormat format = format_of_content(content);
  MARBLE_ASSIGN_OR_RETURN(auto file, parse_problem(content, format, "stdin"));
  NamedProblem named{std::move(file), {}};
  if (format == FileFormat::binary) return named;
  MARBLE_ASSIGN_OR_RETURN(named.names, names_of_json(content, named.file.problem));
  return named;
}

}  // namespace

Expected<ProblemNames> names_of_json(const std::string& text, const OwnedProblem& p) {
  MARBLE_ASSIGN_OR_RETURN(const auto given, names_member(text));
  if (given.is_null()) return ProblemNames{};
  if (!given.is_object())
    return unexpected(invalid("names", "must be an object {variables, equalities, inequalities, pairs}"));
  ProblemNames names;
  for (const auto& [key, count, into] : {std::tuple{"variables", p.g.size(), &names.variables},
                                         std::tuple{"equalities", p.b.size(), &names.equalities},
                                         std::tuple{"inequalities", p.d.size(), &names.inequalities},
                                         std::tuple{"pairs", p.l.size(), &names.pairs}}) {
    MARBLE_ASSIGN_OR_RETURN(*into, texts(given, key, count));
  }
  return names;
}

Expected<ProblemNames> names_of_file(const std::string& path, const OwnedProblem& problem) {
  const bool json = path.ends_with(".json");
  if (!json && !path.ends_with(".nl")) return ProblemNames{};
  MARBLE_ASSIGN_OR_RETURN(const auto content, formats::read_bytes(path));
  if (json) return names_of_json(content, problem);
  const auto names = formats::NlNames::beside(path.substr(0, path.size() - 3));
  MARBLE_ASSIGN_OR_RETURN(const auto nl, formats::parse_nl_problem(content, problem.name, names));
  return nl_names(nl, names);
}

Expected<NamedProblem> read_named_problem(const std::string& path) {
  if (path != "-") {
    MARBLE_ASSIGN_OR_RETURN(auto file, formats::read_any_problem(path));
    MARBLE_ASSIGN_OR_RETURN(auto names, names_of_file(path, file.problem));
    return NamedProblem{std::move(file), std::move(names)};
  }
  return or_out_of_memory(read_standard_input, [] {
    return failure(ErrorCode::resource_exhausted, "is too large for the memory there is");
  });
}

std::string with_names(std::string problem, const ProblemNames& names) {
  Json members;
  for (const auto& [key, given] :
       {std::pair{"variables", &names.variables}, std::pair{"equalities", &names.equalities},
        std::pair{"inequalities", &names.inequalities}, std::pair{"pairs", &names.pairs}}) {
    if (!given->empty()) members[key] = *given;
  }
  if (!members.empty()) problem.insert(problem.rfind('}'), ",\"names\":" + line(members));
  return problem;
}

}  // namespace marble::cli
