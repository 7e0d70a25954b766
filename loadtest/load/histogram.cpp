#include "histogram.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace marble::load {
namespace {

constexpr int kHalfBits = 10;  // 1024 buckets per power of two: 2⁻¹⁰ is the third digit
constexpr std::uint64_t kHalf = 1ULL << kHalfBits;
constexpr std::uint64_t kLinear = 2 * kHalf;

std::size_t bucket_of(std::int64_t value) {
  const auto v = static_cast<std::uint64_t>(value);
  if (v < kLinear) return v;
  const int shift = static_cast<int>(std::bit_width(v)) - (kHalfBits + 1);
  return kLinear + static_cast<std::size_t>(shift - 1) * kHalf + ((v >> shift) - kHalf);
}

std::int64_t last_of(std::size_t bucket) {
  if (bucket < kLinear) return static_cast<std::int64_t>(bucket);
  const std::uint64_t beyond = bucket - kLinear;
  const auto shift = static_cast<int>(beyond / kHalf) + 1;
  return static_cast<std::int64_t>((((beyond % kHalf) + kHalf + 1) << shift) - 1);
}

}  // namespace

void Histogram::add(std::int64_t value, std::uint64_t times) {
  if (times == 0) return;
  value = std::max<std::int64_t>(0, value);
  const std::size_t bucket = bucket_of(value);
  if (bucket >= buckets_.size()) buckets_.resize(bucket + 1);
  buckets_[bucket] += times;
  least_ = count_ == 0 ? value : std::min(least_, value);
  most_ = std::max(most_, value);
  sum_ += static_cast<double>(value) * static_cast<double>(times);
  count_ += times;
}

void Histogram::merge(const Histogram& other) {
  if (other.count_ == 0) return;
  if (other.buckets_.size() > buckets_.size()) buckets_.resize(other.buckets_.size());
  for (std::size_t i = 0; i < other.buckets_.size(); ++i) buckets_[i] += other.buckets_[i];
  least_ = count_ == 0 ? other.least_ : std::min(least_, other.least_);
  most_ = std::max(most_, other.most_);
  sum_ += other.sum_;
  count_ += other.count_;
}

void Histogram::clear() {
  if (count_ == 0) return;
  std::fill(buckets_.begin(), buckets_.end(), 0);
  count_ = 0;
  least_ = most_ = 0;
  sum_ = 0.0;
}

double Histogram::mean() const { return count_ == 0 ? 0.0 : sum_ / static_cast<double>(count_); }

std::int64_t Histogram::quantile(double part) const {
  if (count_ == 0) return 0;
  const double rank = std::ceil(std::clamp(part, 0.0, 1.0) * static_cast<double>(count_));
  const auto wanted = std::clamp<std::uint64_t>(static_cast<std::uint64_t>(rank), 1, count_);
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    seen += buckets_[i];
    if (seen >= wanted) return std::clamp(last_of(i), least_, most_);
  }
  return most_;
}

std::vector<Histogram::Step> Histogram::steps() const {
  std::vector<Step> result;
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    if (buckets_[i] == 0) continue;
    seen += buckets_[i];
    result.push_back({std::min(last_of(i), most_), static_cast<double>(seen) / static_cast<double>(count_)});
  }
  return result;
}

}  // namespace marble::load
