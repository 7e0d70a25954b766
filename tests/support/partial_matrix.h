// Provides matrices that are neither empty nor complete.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "marble/problem.h"

namespace marble::testing {

/// A change of a complete or an empty matrix with `columns` columns to one that must be rejected, and its
/// name.
struct PartialMatrix {
  const char* name;
  std::function<void(SparseMatrix&, Index columns)> make;
};

/// Without rows: forms that no problem may have, whatever its sizes.
[[nodiscard]] inline std::vector<PartialMatrix> partial_matrices() {
  return {
      {"columns alone",
       [](SparseMatrix& m, Index columns) {
         m = {0, columns, {}, {}, {}};
       }},
      {"other columns alone",
       [](SparseMatrix& m, Index columns) {
         m = {0, columns + 7, {}, {}, {}};
       }},
      {"many columns alone",
       [](SparseMatrix& m, Index) {
         m = {0, 65536, {}, {}, {}};
       }},
      {"negative columns alone",
       [](SparseMatrix& m, Index) {
         m = {0, -1, {}, {}, {}};
       }},
      {"rows alone",
       [](SparseMatrix& m, Index) {
         m = {3, 0, {}, {}, {}};
       }},
      {"negative rows alone",
       [](SparseMatrix& m, Index) {
         m = {-1, 0, {}, {}, {}};
       }},
      {"one row index alone",
       [](SparseMatrix& m, Index) {
         m = {0, 0, {}, {65536}, {}};
       }},
      {"one value alone",
       [](SparseMatrix& m, Index) {
         m = {0, 0, {}, {}, {1.0}};
       }},
      {"one entry alone",
       [](SparseMatrix& m, Index) {
         m = {0, 0, {}, {65536}, {1.0}};
       }},
      {"one pointer alone",
       [](SparseMatrix& m, Index) {
         m = {0, 0, {0}, {}, {}};
       }},
      {"pointers alone",
       [](SparseMatrix& m, Index columns) {
         m = {0, 0, std::vector<Index>(static_cast<std::size_t>(columns) + 1, 0), {}, {}};
       }},
      {"a pointer too few",
       [](SparseMatrix& m, Index columns) {
         m = {0, columns, std::vector<Index>(static_cast<std::size_t>(columns), 0), {}, {}};
       }},
      {"an entry without a row",
       [](SparseMatrix& m, Index columns) {
         m = {0, columns, std::vector<Index>(static_cast<std::size_t>(columns) + 1, 1), {0}, {1.0}};
         m.column_pointers[0] = 0;
       }},
      {"pointers beyond the entries",
       [](SparseMatrix& m, Index columns) {
         m = {0, columns, std::vector<Index>(static_cast<std::size_t>(columns) + 1, 1000), {}, {}};
         m.column_pointers[0] = 0;
       }},
  };
}

/// Returns the complete matrix without rows.
[[nodiscard]] inline SparseMatrix without_rows(Index columns) {
  return {0, columns, std::vector<Index>(static_cast<std::size_t>(columns) + 1, 0), {}, {}};
}

/// Returns the matrices of a problem by their letters.
[[nodiscard]] inline std::vector<std::pair<std::string, SparseMatrix OwnedProblem::*>>
matrices_of_a_problem() {
  return {{"Q", &OwnedProblem::Q},
          {"A", &OwnedProblem::A},
          {"C", &OwnedProblem::C},
          {"L", &OwnedProblem::L},
          {"R", &OwnedProblem::R}};
}

}  // namespace marble::testing
