#include "npz_problem.h"

#include <zip.h>

#include <cmath>
#include <deque>
#include <memory>

#include "file_bytes.h"
#include "npy.h"
#include "tables.h"

namespace marble::formats {
namespace {

struct CloseArchive {
  void operator()(zip_t* archive) const { zip_discard(archive); }
};
using Archive = std::unique_ptr<zip_t, CloseArchive>;

class NpzReader {
 public:
  NpzReader(Archive archive, std::size_t length)
      : archive_(std::move(archive)), most_bytes_(most_bytes(length)), most_rows_(most_rows(length)) {}

  Expected<std::optional<TableMatrix>> read(const std::string& name) {
    if (const auto values = array(name, ".data"); !values || *values) {
      if (!values) return unexpected(values.error());
      return sparse(name, **values);
    }
    MARBLE_ASSIGN_OR_RETURN(const auto dense, array(name, ""));
    if (!dense) return std::nullopt;
    return table_of(name, *dense);
  }

  Expected<std::map<std::string, NpyArray>> all() {
    std::map<std::string, NpyArray> arrays;
    for (zip_int64_t i = 0; i < zip_get_num_entries(archive_.get(), 0); ++i) {
      const char* const entry = zip_get_name(archive_.get(), static_cast<zip_uint64_t>(i), 0);
      std::string name = entry != nullptr ? entry : "";
      if (!name.ends_with(".npy")) continue;
      name.resize(name.size() - 4);
      MARBLE_ASSIGN_OR_RETURN(auto parsed, array(name, ""));
      if (parsed) arrays.emplace(std::move(name), *std::move(parsed));
    }
    return arrays;
  }

 private:
  Expected<std::optional<NpyArray>> array(const std::string& name, std::string suffix) {
    zip_int64_t at = zip_name_locate(archive_.get(), (name + suffix + ".npy").c_str(), 0);
    if (at < 0 && !suffix.empty()) {
      suffix[0] = '_';
      at = zip_name_locate(archive_.get(), (name + suffix + ".npy").c_str(), 0);
    }
    if (at < 0) return std::nullopt;
    zip_stat_t about;
    zip_stat_init(&about);
    const auto index = static_cast<zip_uint64_t>(at);
    if (zip_stat_index(archive_.get(), index, 0, &about) != 0 || (about.valid & ZIP_STAT_SIZE) == 0)
      return unexpected(invalid(name + suffix, "cannot be read"));
    if (about.size > most_bytes_) {
      return unexpected(invalid(name + suffix, "must unpack to at most " + std::to_string(most_bytes_) +
                                                   " bytes, for the file's length"));
    }
    const std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> file(zip_fopen_index(archive_.get(), index, 0),
                                                                 &zip_fclose);
    std::string bytes(about.size, '\0');
    if (file == nullptr ||
        zip_fread(file.get(), bytes.data(), bytes.size()) != static_cast<zip_int64_t>(bytes.size()))
      return unexpected(invalid(name + suffix, "cannot be read"));
    MARBLE_ASSIGN_OR_RETURN(auto parsed, parse_npy(bytes, name + suffix));
    return parsed;
  }

  [[nodiscard]] Expected<std::optional<TableMatrix>> table_of(const std::string& name,
                                                              const NpyArray& dense) const {
    if (dense.shape.size() > 2) return unexpected(invalid(name, "must have at most two dimensions"));
    for (const std::size_t extent : dense.shape) {
      if (extent > most_rows_) return unexpected(invalid(name, "must have " + sizes_rule()));
    }
    TableMatrix table;
    table.rows = static_cast<Index>(dense.shape.empty() ? 1 : dense.shape[0]);
    table.columns = static_cast<Index>(dense.shape.size() < 2 ? 1 : dense.shape[1]);
    if (dense.values.empty() && table.rows > 0 && table.columns > 0)
      return unexpected(invalid(name, "must hold numbers"));
    const auto rows = static_cast<std::size_t>(table.rows), columns = static_cast<std::size_t>(table.columns);
    for (std::size_t k = 0; k < dense.values.size(); ++k) {
      if (dense.values[k] == 0.0) continue;
      const std::size_t row = dense.column_major ? k % rows : k / columns;
      const std::size_t column = dense.column_major ? k / rows : k % columns;
      table.entries.add(static_cast<Index>(row), static_cast<Index>(column), dense.values[k]);
    }
    return table;
  }

  [[nodiscard]] std::string sizes_rule() const {
    return "at most " + std::to_string(most_rows_) + " rows and columns, for the file's length";
  }

  // Returns a number as a count or index below `end`.
  static std::optional<std::size_t> index_of(double value, std::size_t end) {
    if (!(value >= 0.0) || value >= static_cast<double>(end) || value != std::floor(value))
      return std::nullopt;
    return static_cast<std::size_t>(value);
  }

  Expected<std::optional<TableMatrix>> sparse(const std::string& name, const NpyArray& values) {
    const auto indices = array(name, ".indices"), pointers = array(name, ".indptr"),
               shape = array(name, ".shape"), format = array(name, ".format");
    for (const auto* part : {&indices, &pointers, &shape, &format}) {
      if (!*part) return unexpected(part->error());
    }
    if (!*indices || !*pointers || !*shape)
      return unexpected(invalid(name, "must have .data, .indices, .indptr and .shape"));
    const std::string kind = *format ? (*format)->text : "csc";
    if (kind != "csc" && kind != "csr") return unexpected(invalid(name + ".format", "must be csc or csr"));
    const auto& sizes = (*shape)->values;
    const auto rows = sizes.size() == 2 ? index_of(sizes[0], most_rows_ + 1) : std::nullopt;
    const auto columns = sizes.size() == 2 ? index_of(sizes[1], most_rows_ + 1) : std::nullopt;
    if (!rows || !columns)
      return unexpected(invalid(name + ".shape", "must be two sizes, with " + sizes_rule()));
    TableMatrix table{static_cast<Index>(*rows), static_cast<Index>(*columns)};
    const bool by_column = kind == "csc";
    const std::size_t outer = by_column ? *columns : *rows, inner = by_column ? *rows : *columns;
    const auto& starts = (*pointers)->values;
    const auto& inners = (*indices)->values;
    if (starts.size() != outer + 1)
      return unexpected(invalid(name + ".indptr", "must have " + std::to_string(outer + 1) + " entries"));
    if (inners.size() != values.values.size())
      return unexpected(invalid(name + ".indices", "must have as many entries as .data"));
    std::size_t next = 0;
    for (std::size_t o = 0; o < outer; ++o) {
      const auto end = index_of(starts[o + 1], inners.size() + 1);
      if (!end || *end < next || starts[0] != 0.0)
        return unexpected(invalid(name + ".indptr", "must ascend from 0 to the number of entries"));
      for (; next < *end; ++next) {
        const auto i = index_of(inners[next], inner);
        if (!i)
          return unexpected(invalid(name + ".indices", "must be in [0, " + std::to_string(inner) + ")"));
        table.entries.add(static_cast<Index>(by_column ? *i : o), static_cast<Index>(by_column ? o : *i),
                          values.values[next]);
      }
    }
    if (next != inners.size())
      return unexpected(invalid(name + ".indptr", "must ascend from 0 to the number of entries"));
    return table;
  }

  Archive archive_;
  const std::size_t most_bytes_, most_rows_;
};

class NpzWriter {
 public:
  explicit NpzWriter(Archive archive) : archive_(std::move(archive)) {}

  // libzip reads the bytes when it closes.
  bool add(const std::string& name, std::string bytes) {
    arrays_.push_back(std::move(bytes));
    zip_source_t* source = zip_source_buffer(archive_.get(), arrays_.back().data(), arrays_.back().size(), 0);
    if (source == nullptr) return false;
    if (zip_file_add(archive_.get(), (name + ".npy").c_str(), source, ZIP_FL_OVERWRITE) >= 0) return true;
    zip_source_free(source);
    return false;
  }
  bool add(const std::string& name, const SparseMatrix& matrix) {
    return add(name + ".data", write_npy(matrix.values)) &&
           add(name + ".indices", write_npy(matrix.row_indices)) &&
           add(name + ".indptr", write_npy(matrix.column_pointers)) &&
           add(name + ".shape", write_npy(std::vector<std::int32_t>{matrix.rows, matrix.columns}));
  }
  bool close() {
    if (zip_close(archive_.get()) != 0) return false;
    static_cast<void>(archive_.release());
    return true;
  }

 private:
  Archive archive_;
  std::deque<std::string> arrays_;
};

// The bytes must outlive the reader.
Expected<NpzReader> reader_of(std::string_view bytes) {
  const Error no_archive = failure(ErrorCode::invalid_argument, "cannot be read as an .npz file");
  zip_source_t* source = zip_source_buffer_create(bytes.data(), bytes.size(), 0, nullptr);
  if (source == nullptr) return unexpected(no_archive);
  Archive archive(zip_open_from_source(source, ZIP_RDONLY, nullptr));
  if (archive == nullptr) {
    zip_source_free(source);
    return unexpected(no_archive);
  }
  return NpzReader(std::move(archive), bytes.size());
}

}  // namespace

Expected<ProblemFile> parse_npz(std::string_view bytes, const std::string& name) {
  MARBLE_ASSIGN_OR_RETURN(auto reader, reader_of(bytes));
  return assemble_tables([&](const char* part) { return reader.read(part); }, name);
}

Expected<std::map<std::string, NpyArray>> read_npz_arrays(const std::string& path) {
  MARBLE_ASSIGN_OR_RETURN(const auto bytes, read_bytes(path));
  auto reader = reader_of(bytes);
  return reader ? reader->all() : unexpected(reader.error());
}

Expected<ProblemFile> read_npz(const std::string& path, const std::string& name) {
  MARBLE_ASSIGN_OR_RETURN(const auto bytes, read_bytes(path));
  return parse_npz(bytes, name);
}

Expected<void> write_npz(const ProblemFile& file, const std::string& path) {
  const Error unwritable = failure(ErrorCode::unavailable, "cannot be written");
  int code = 0;
  Archive archive(zip_open(path.c_str(), ZIP_CREATE | ZIP_TRUNCATE, &code));
  if (archive == nullptr) return unexpected(unwritable);
  NpzWriter writer(std::move(archive));
  TableSink sink;
  sink.matrix = [&](const char* name, const SparseMatrix& matrix) -> Expected<void> {
    if (!writer.add(name, matrix)) return unexpected(unwritable);
    return {};
  };
  sink.vector = [&](const char* name, const std::vector<double>& vector) -> Expected<void> {
    if (!writer.add(name, write_npy(vector))) return unexpected(unwritable);
    return {};
  };
  MARBLE_RETURN_IF_ERROR(write_tables(file, sink));
  if (!writer.close()) return unexpected(unwritable);
  return {};
}

}  // namespace marble::formats
