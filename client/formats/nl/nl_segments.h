// The segments of an .nl file; what its expressions may be, who derives from this decides.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "nl/nl_model.h"
#include "nl/nl_tokens.h"
#include "parts/nesting.h"

namespace marble::formats {

/// "exp" of 44; empty of those that an LCQP may have, and of what is none.
[[nodiscard]] std::string operator_name(int code);

class NlSegments {
 public:
  virtual ~NlSegments() = default;

 protected:
  using Kind = NlPlace::Kind;
  using Terms = std::vector<std::pair<Index, double>>;

  /// `whole`: what the file is to be, in errors ("an LCQP").
  NlSegments(std::string_view content, const NlNames& names, const char* whole)
      : in_(content), names_(names), length_(content.size()), whole_(whole) {}

  /// From the header to the end; sizes of the model are set before the first hook is called. Errors name row
  /// or variable.
  [[nodiscard]] Expected<void> read_segments();

  /// Each reads the expression that comes next.
  virtual void read_row(int row) = 0;
  virtual void read_objective() = 0;
  virtual void read_definition(int index, Terms linear) = 0;
  /// Of the segments J and G.
  virtual void add_row_term(int row, Index variable, double coefficient) = 0;
  virtual void add_objective_term(Index variable, double coefficient) = 0;

  static std::size_t at(int index) { return static_cast<std::size_t>(index); }

  /// What of the model is being read: a fault names it.
  void enter(Kind kind, int index = 0) {
    if (!in_.failed()) place_ = {kind, index};
  }

  /// Into a node of an expression, and out of it again. A fault where it is too deep, or would be with `more`
  /// inside it.
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
  const std::size_t deepest_ = static_cast<std::size_t>(deepest_nesting());
  std::size_t depth_ = 0;
  NlPlace place_;
  struct {
    std::int64_t objectives = 0, row_bounds = 0, bounds = 0, jacobian = 0, gradient = 0;
  } seen_;  // of what the header tells
};

}  // namespace marble::formats
