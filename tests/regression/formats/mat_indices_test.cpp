// `marble convert broken.mat x.pb` ended with a segmentation fault, or took all memory of the machine.
//
// The reader of .mat files trusted what the file says: jc and ir of a sparse matrix were read and written
// with as they stood, and libmatio allocated whatever sizes the file named.
#include <gtest/gtest.h>
#include <matio.h>

#include <algorithm>
#include <cstdint>
#include <fstream>

#include "mat/mat_problem.h"
#include "support/processes/child_process.h"

namespace marble::formats {
namespace {

/// A file of MATLAB 5, element by element, of a machine of either byte order.
class Mat5 {
 public:
  explicit Mat5(bool big_endian = false) : bytes_(124, ' '), big_endian_(big_endian) {
    bytes_ += big_endian ? std::string("\1\0MI", 4) : std::string("\0\1IM", 4);
  }

  Mat5& dense(const std::string& name, std::int32_t rows, std::int32_t columns,
              const std::vector<double>& values) {
    return matrix(6, name, rows, columns, element(9, values));
  }
  Mat5& sparse(const std::string& name, std::int32_t rows, std::int32_t columns,
               const std::vector<std::int32_t>& ir, const std::vector<std::int32_t>& jc,
               const std::vector<double>& values) {
    return matrix(5, name, rows, columns, element(5, ir) + element(5, jc) + element(9, values));
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  template <class Number>
  void append(std::string& text, Number value) const {
    std::string raw(reinterpret_cast<const char*>(&value), sizeof value);
    if (big_endian_) std::reverse(raw.begin(), raw.end());
    text += raw;
  }
  template <class Number>
  [[nodiscard]] std::string element(std::uint32_t type, const std::vector<Number>& values) const {
    std::string text;
    append(text, type);
    append(text, static_cast<std::uint32_t>(values.size() * sizeof(Number)));
    for (const Number value : values) append(text, value);
    text.resize((text.size() + 7) / 8 * 8);
    return text;
  }
  Mat5& matrix(std::uint32_t kind, const std::string& name, std::int32_t rows, std::int32_t columns,
               const std::string& data) {
    const std::string content = element(6, std::vector<std::uint32_t>{kind, 0}) +
                                element(5, std::vector<std::int32_t>{rows, columns}) +
                                element(1, std::vector<char>(name.begin(), name.end())) + data;
    bytes_ += element(14, std::vector<char>(content.begin(), content.end()));
    return *this;
  }
  std::string bytes_;
  bool big_endian_;
};

std::string refusal(const std::string& bytes) {
  const auto file = parse_mat(bytes, "broken");
  return file ? "taken" : file.error().message();
}

class SoundMat : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(BigEndian, SoundMat, ::testing::Bool());

TEST_P(SoundMat, IsTaken) {
  Mat5 mat(GetParam());
  mat.sparse("Q", 2, 2, {0, 1}, {0, 1, 2}, {2.0, 4.0}).dense("g", 2, 1, {-1.0, 0.5});
  const auto file = parse_mat(mat.bytes(), "sound");
  ASSERT_TRUE(file.has_value()) << file.error().message();
  EXPECT_EQ(file->problem.Q.values, (std::vector<double>{2.0, 4.0}));
  EXPECT_EQ(file->problem.g, (std::vector<double>{-1.0, 0.5}));
}

TEST(MatIndices, OutsideTheMatrixAreRefusedWithTheirPlace) {
  const struct {
    std::vector<std::int32_t> ir, jc;
    const char* reason;
  } cases[] = {
      {{0, 2}, {0, 1, 2}, "Q.ir[1]: must be in [0, 2)"},
      {{0, -1}, {0, 1, 2}, "Q.ir[1]: must be in [0, 2)"},
      {{0, 1}, {0, 1, 3}, "Q.jc[1]: must ascend from 0 to 2 at most"},
      {{0, 1}, {0, 1, 0x7fffffff}, "Q.jc[1]: must ascend from 0 to 2 at most"},
      {{0, 1}, {0, -1, 2}, "Q.jc[0]: must ascend from 0 to 2 at most"},
      {{0, 1}, {1, 1, 2}, "Q.jc[0]: must ascend from 0 to 2 at most"},
      {{0, 1}, {0, 2, 1}, "Q.jc[1]: must ascend from 0 to 2 at most"},
      {{0, 1}, {0, 1}, "Q.jc: must have 3 entries"},
      {{0}, {0, 1, 2}, "Q.jc[1]: must ascend from 0 to 1 at most"},
  };
  for (const auto& [ir, jc, reason] : cases) {
    Mat5 mat;
    mat.sparse("Q", 2, 2, ir, jc, {2.0, 4.0}).dense("g", 2, 1, {-1.0, 0.5});
    EXPECT_NE(refusal(mat.bytes()).find(reason), std::string::npos) << refusal(mat.bytes());
  }
}

TEST(MatIndices, SizesAreBoundedByTheFilesLength) {
  Mat5 columns;
  columns.sparse("Q", 1, 0x7fffffff, {}, {0}, {}).dense("g", 1, 1, {1.0});
  EXPECT_NE(refusal(columns.bytes()).find("Q: must be a matrix or a vector with at most"), std::string::npos)
      << refusal(columns.bytes());
  Mat5 dense;
  dense.dense("Q", 40'000, 40'000, {1.0}).dense("g", 1, 1, {1.0});
  EXPECT_NE(refusal(dense.bytes()).find("Q: ends too soon"), std::string::npos) << refusal(dense.bytes());
  Mat5 negative;
  negative.dense("Q", -1, 1, {1.0}).dense("g", 1, 1, {1.0});
  EXPECT_NE(refusal(negative.bytes()).find("Q: must be a matrix"), std::string::npos)
      << refusal(negative.bytes());
}

/// A file of version 7.3 as libmatio writes it: Q with this jc, and g.
std::string write_mat73(const std::string& path, std::vector<mat_uint32_t> jc, std::vector<mat_uint32_t> ir) {
  mat_t* file = Mat_CreateVer(path.c_str(), nullptr, MAT_FT_MAT73);
  std::size_t square[] = {2, 2}, column[] = {2, 1};
  double values[] = {2.0, 4.0}, g[] = {-1.0, 0.5};
  mat_sparse_t sparse = {};
  sparse.nzmax = sparse.ndata = sparse.nir = 2;
  sparse.ir = ir.data();
  sparse.njc = 3;
  sparse.jc = jc.data();
  sparse.data = values;
  for (matvar_t* variable :
       {Mat_VarCreate("Q", MAT_C_SPARSE, MAT_T_DOUBLE, 2, square, &sparse, MAT_F_DONT_COPY_DATA),
        Mat_VarCreate("g", MAT_C_DOUBLE, MAT_T_DOUBLE, 2, column, g, MAT_F_DONT_COPY_DATA)}) {
    EXPECT_EQ(Mat_VarWrite(file, variable, MAT_COMPRESSION_NONE), 0);
    Mat_VarFree(variable);
  }
  Mat_Close(file);
  return path;
}

TEST(Mat73, IsReadAndItsIndicesAreChecked) {
  const marble::testing::TemporaryDirectory folder;
  const auto sound = read_mat(write_mat73(folder.file("sound.mat"), {0, 1, 2}, {0, 1}), "sound");
  ASSERT_TRUE(sound.has_value()) << sound.error().message();
  EXPECT_EQ(sound->problem.Q.values, (std::vector<double>{2.0, 4.0}));
  EXPECT_EQ(sound->problem.g, (std::vector<double>{-1.0, 0.5}));
  EXPECT_EQ(sound->problem.name, "sound");
  const auto row = read_mat(write_mat73(folder.file("row.mat"), {0, 1, 2}, {0, 2}), "row");
  ASSERT_FALSE(row.has_value());
  EXPECT_EQ(row.error().message(), "Q.ir[1]: must be in [0, 2)");
  const auto start = read_mat(write_mat73(folder.file("start.mat"), {0, 1, 1'000'000}, {0, 1}), "start");
  ASSERT_FALSE(start.has_value());
  EXPECT_NE(start.error().message().find("Q.jc[1]: must ascend"), std::string::npos)
      << start.error().message();
}

TEST(Mat73, OfWhichAnyByteIsBrokenIsTakenOrRefusedAndTheReaderGoesOn) {
  const marble::testing::TemporaryDirectory folder;
  const std::string path = write_mat73(folder.file("sound.mat"), {0, 1, 2}, {0, 1});
  std::ifstream file(path, std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(file)), {});
  for (std::size_t at = 512; at < whole.size(); at += 97) {
    std::string broken = whole;
    for (std::size_t k = at; k < std::min(at + 4, broken.size()); ++k) broken[k] = '\xff';
    std::ofstream(folder.file("broken.mat"), std::ios::binary) << broken;
    const auto read = read_mat(folder.file("broken.mat"), "broken");
    EXPECT_TRUE(read || !read.error().message().empty());
  }
}

}  // namespace
}  // namespace marble::formats
