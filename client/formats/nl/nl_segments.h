// Reads the segments of an .nl file; a derived class decides which expressions are allowed.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "nl/nl_model.h"
#include "nl/nl_tokens.h"

namespace marble::formats {

/// Returns a name such as "exp" for 44; empty for operators that an LCQP may have, and for unknown ones.
[[nodiscard]] std::string operator_name(int code);

class NlSegments {
 public:
  virtual ~NlSegments() = default;

 protected:
  using Kind = NlPlace::Kind;
  using Terms = std::vector<std::pair<Index, double>>;

  /// `whole`: what the file must be, for errors ("an LCQP").
  NlSegments(std::string_view content, const NlNames& names, const char* whole);

  /// Reads from the header to the end; the model's sizes are set before the first hook is called. Errors name
  /// row or variable.
  [[nodiscard]] Expected<void> read_segments();

  /// Each reads the next expression.
  virtual void read_row(int row) = 0;
  virtual void read_objective() = 0;
  virtual void read_definition(int index, Terms linear) = 0;
  /// For the segments J and G.
  virtual void add_row_term(int row, Index variable, double coefficient) = 0;
  virtual void add_objective_term(Index variable, double coefficient) = 0;

  static std::size_t at(int index) { return static_cast<std::size_t>(index); }

  /// Sets the current part of the model: an error names it.
  void enter(Kind kind, int index = 0) {
    if (!in_.failed()) place_ = {kind, index};
  }

  /// Enters a node of an expression; ascend() leaves it. An error if it is too deep, or would be with `more`
  /// nodes inside.
  void descend(std::size_t more = 0);
  void ascend() { --depth_; }

  NlTokens in_;
  const NlNames& names_;
  const std::size_t length_;  ///< of the file, bytes
  NlHeader header_;
  NlModel model_;

 private:
  void check_header();
  void check_complete();
  void segment(char key);
  void constraint();
  void objective();
  void definition();
  void jacobian_row();
  template <class Add>
  void linear_terms(std::int64_t& seen, const Add& add);
  [[nodiscard]] NlBounds bound(const char* what, bool may_complement);
  void numbers(char key, int size, std::vector<double>& values);
  void skip_pairs(int count);
  void suffix();

  const char* whole_;
  const std::size_t deepest_;  ///< nodes of an expression, by the stack that is left
  std::size_t depth_ = 0;
  NlPlace place_;
  struct {
    std::int64_t objectives = 0, row_bounds = 0, bounds = 0, jacobian = 0, gradient = 0;
  } seen_;  // of the items that the header announces
};

}  // namespace marble::formats
