#include "commands/coupled_file.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "file_bytes.h"
#include "formats.h"
#include "output/json.h"

namespace marble::cli {
namespace {

template <class Value>
Expected<Value> field_in(const nlohmann::json& object, const char* name) {
  if (!object.is_object() || !object.contains(name)) return unexpected(invalid(name, "must be there"));
  try {
    return object.at(name).get<Value>();
  } catch (const nlohmann::json::exception&) {
    return unexpected(invalid(name, "is of the wrong type"));
  }
}

Expected<SparseMatrix> coupling_of(const nlohmann::json& object) {
  const auto rows = field_in<Index>(object, "rows"), columns = field_in<Index>(object, "cols");
  auto i = field_in<std::vector<Index>>(object, "i"), j = field_in<std::vector<Index>>(object, "j");
  auto v = field_in<std::vector<double>>(object, "v");
  for (const auto* const size : {&rows, &columns})
    if (!*size) return unexpected(size->error());
  for (const auto* const list : {&i, &j})
    if (!*list) return unexpected(list->error());
  if (!v) return unexpected(v.error());
  if (*rows < 0) return unexpected(invalid("rows", std::to_string(*rows), "must be >= 0"));
  if (*columns < 0) return unexpected(invalid("cols", std::to_string(*columns), "must be >= 0"));
  if (i->size() != v->size() || j->size() != v->size())
    return unexpected(invalid("v", std::to_string(v->size()), "must have as many entries as i and j"));
  Triplets entries;
  entries.rows = *std::move(i);
  entries.columns = *std::move(j);
  entries.values = *std::move(v);
  return compress(*rows, *columns, entries, "");
}

Expected<void> take_block(const nlohmann::json& object, const std::filesystem::path& beside,
                          CoupledFile& file) {
  const auto name = field_in<std::string>(object, "problem");
  if (!name) return unexpected(name.error());
  auto read = formats::read_any_problem((beside / *name).string());
  if (!read) {
    const std::string& field = read.error().field;
    return unexpected(of_field("problem (" + *name + ")" + (field.empty() ? "" : "." + field), read.error()));
  }
  file.blocks.push_back(std::move(read->problem));
  SparseMatrix& coupling = file.coupling.emplace_back();
  if (!object.contains("coupling")) return {};
  auto matrix = coupling_of(object.at("coupling"));
  if (!matrix) return unexpected(inside("coupling", matrix.error()));
  coupling = *std::move(matrix);
  return {};
}

}  // namespace

CoupledView CoupledFile::view() const {
  CoupledView view{{}, total};
  for (std::size_t k = 0; k < blocks.size(); ++k)
    view.blocks.push_back({blocks[k].name, blocks[k].view(), coupling[k].view()});
  return view;
}

Expected<CoupledFile> read_coupled(const std::string& path) {
  const auto bytes = formats::read_bytes(path);
  if (!bytes) return unexpected(bytes.error());
  const nlohmann::json content = parsed<nlohmann::json>(*bytes);
  if (!content.is_object())
    return unexpected(
        invalid("", "must be a JSON object, nested at most " + std::to_string(kDeepestJson) + " deep"));
  CoupledFile file;
  auto total = field_in<std::vector<double>>(content, "total");
  if (!total) return unexpected(total.error());
  file.total = *std::move(total);
  if (!content.contains("blocks") || !content.at("blocks").is_array())
    return unexpected(invalid("blocks", "must be a list"));
  const nlohmann::json& blocks = content.at("blocks");
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    auto taken = take_block(blocks.at(k), std::filesystem::path(path).parent_path(), file);
    if (!taken) return unexpected(inside("blocks[" + std::to_string(k) + "]", taken.error()));
  }
  if (auto valid = check(file.view()); !valid) return unexpected(valid.error());
  return file;
}

}  // namespace marble::cli
