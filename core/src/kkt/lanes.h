// SIMD batch of numbers that pass through the same loop: an algorithm written for a number type T runs on one
// vector with T = double, and on eight with T = Lanes<8>, which reads indices only once for all.
#pragma once

#include <utility>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace marble {

using LanePair [[gnu::vector_size(16), gnu::may_alias]] = double;

inline LanePair larger_pair(LanePair a, LanePair x) {
#ifdef __SSE2__  // compilers' code for the other line takes three times as long
  return _mm_max_pd(_mm_andnot_pd(_mm_set1_pd(-0.0), x), a);
#else
  const LanePair size = x < 0.0 ? -x : x;
  return size > a ? size : a;
#endif
}

/// N numbers, N = 2, 4 or 8, contiguous in memory.
template <int N>
struct Lanes {
  static_assert(N % 2 == 0);
  LanePair pairs[N / 2];

  Lanes& operator+=(const Lanes& other) {
    return each(other, [](auto& a, auto b) { a += b; });
  }
  Lanes& operator-=(const Lanes& other) {
    return each(other, [](auto& a, auto b) { a -= b; });
  }
  Lanes& operator*=(double factor) {
    return each(*this, [factor](auto& a, auto) { a *= factor; });
  }
  friend Lanes operator*(double factor, Lanes x) { return x *= factor; }
  friend Lanes operator+(Lanes a, const Lanes& b) { return a += b; }
  friend Lanes operator-(Lanes a, const Lanes& b) { return a -= b; }
  friend Lanes operator-(const Lanes& x) { return -1.0 * x; }
  friend Lanes product(Lanes a, const Lanes& b) {
    return a.each(b, [](auto& x, auto y) { x *= y; });
  }
  /// Returns in each lane the larger of a ≥ 0 and |x|; ignores NaN.
  friend Lanes larger(Lanes a, const Lanes& x) {
    return a.each(x, [](auto& most, auto y) { most = larger_pair(most, y); });
  }

 private:
  // Unrolled: compilers would keep a loop and move the numbers out of their registers.
  template <class Work>
  Lanes& each(const Lanes& other, const Work& work) {
    [&]<int... I>(std::integer_sequence<int, I...>) { (work(pairs[I], other.pairs[I]), ...); }
    (std::make_integer_sequence<int, N / 2>());
    return *this;
  }
};

inline double product(double a, double b) { return a * b; }
inline double larger(double a, double x) {
  const double size = x < 0.0 ? -x : x;
  return size > a ? size : a;
}

template <class T>
inline constexpr int lanes_of = 1;
template <int N>
inline constexpr int lanes_of<Lanes<N>> = N;

inline double lane(double x, int) { return x; }
template <int N>
double lane(const Lanes<N>& x, int i) {
  return x.pairs[i / 2][i % 2];
}
inline void set_lane(double& x, int, double value) { x = value; }
template <int N>
void set_lane(Lanes<N>& x, int i, double value) {
  x.pairs[i / 2][i % 2] = value;
}
/// Returns the number whose lanes are value_of(lane).
template <class T, class ValueOf>
T made_of(const ValueOf& value_of) {
  if constexpr (lanes_of<T> == 1) {
    return value_of(0);
  } else {
    return [&]<int... I>(std::integer_sequence<int, I...>) {
      return T{{LanePair{value_of(2 * I), value_of(2 * I + 1)}...}};
    }
    (std::make_integer_sequence<int, lanes_of<T> / 2>());
  }
}
/// True if every lane is 0.
inline bool is_zero(double x) { return x == 0.0; }
template <int N>
bool is_zero(const Lanes<N>& x) {
  const Lanes<N> sizes = larger(Lanes<N>{}, x);
  double sum = 0.0;
  for (const LanePair& pair : sizes.pairs) sum += pair[0] + pair[1];
  return sum == 0.0;
}

}  // namespace marble
