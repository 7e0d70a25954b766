// The two sides of a job's pairs at a few iterations, for a plot of s against t. Of many pairs an even
// sample, the same in all frames.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "marble/progress.h"

namespace marble::server {

class PairHistory {
 public:
  static constexpr std::size_t kMostFrames = 16;

  /// Single precision is enough for a plot.
  struct Frame {
    std::int32_t iteration = 0;
    double kappa = 0.0;
    std::vector<float> s, t;
  };

  /// Keeps at most `most_pairs` pairs of a frame.
  explicit PairHistory(std::size_t most_pairs) : most_pairs_(most_pairs) {}

  void put(const Progress& progress) {
    newest_.iteration = progress.iteration;
    newest_.kappa = progress.kappa;
    sample(progress.s, newest_.s);
    sample(progress.t, newest_.t);
    if (count_ % stride_ == 0) {
      if (frames_.size() == kMostFrames) thin();
      if (count_ % stride_ == 0) frames_.push_back(newest_);
    }
    ++count_;
  }

  [[nodiscard]] const Frame& newest() const { return newest_; }
  /// Returns every stride-th frame, oldest first, and the newest.
  [[nodiscard]] std::vector<Frame> frames() const {
    std::vector<Frame> frames = frames_;
    if (count_ > 0 && (count_ - 1) % stride_ != 0) frames.push_back(newest_);
    return frames;
  }
  [[nodiscard]] bool empty() const { return count_ == 0; }

  /// Restores the frames of a solve that has ended.
  void restore(std::vector<Frame> frames) {
    if (frames.empty()) return;
    newest_ = frames.back();
    frames_ = std::move(frames);
    count_ = 1;  // the newest is among them
  }

  /// Starts the history of another solve.
  void begin() {
    frames_.clear();
    stride_ = 1;
    count_ = 0;
  }

 private:
  // The k-th of `kept` is pair k * pairs / kept: clients compute the pair from both numbers.
  void sample(std::span<const double> all, std::vector<float>& kept) const {
    kept.resize(std::min(all.size(), most_pairs_));
    for (std::size_t k = 0; k < kept.size(); ++k)
      kept[k] = static_cast<float>(all[k * all.size() / kept.size()]);
  }

  // Keeps every other frame. The first stays in place: a move onto itself would lose its sides.
  void thin() {
    std::size_t kept = 1;
    for (std::size_t at = 2; at < frames_.size(); at += 2) frames_[kept++] = std::move(frames_[at]);
    frames_.resize(kept);
    stride_ *= 2;
  }

  const std::size_t most_pairs_;
  std::vector<Frame> frames_;
  Frame newest_;
  std::int64_t stride_ = 1, count_ = 0;
};

}  // namespace marble::server
