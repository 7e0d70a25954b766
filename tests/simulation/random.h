// Random numbers of the scheduler, of one client or of one cause of trouble, that follow from a seed.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

namespace marble::simulation {

class Random {
 public:
  explicit Random(std::uint64_t seed) : random_(seed) {}
  std::uint64_t bits() { return random_(); }
  double share() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  bool chance(double probability) { return share() < probability; }
  double between(double least, double most) { return least + (most - least) * share(); }
  double exponential(double mean) { return -mean * std::log(1.0 - share()); }
  std::size_t below(std::size_t count) { return static_cast<std::size_t>(bits() % count); }

 private:
  std::mt19937_64 random_;
};

}  // namespace marble::simulation
