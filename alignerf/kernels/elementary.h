// Exponential and logarithm without branches or tables, so that a compiler makes vectors
// of a loop over them; the C library's are called one by one. Polynomials of Cephes
// (expf.c, logf.c), good to 2 units in the last place.
#pragma once

#include <cstdint>
#include <cstring>
#include <limits>

namespace elementary {

inline int32_t bits_of(float x) {
  int32_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return bits;
}

inline float of_bits(int32_t bits) {
  float x;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}

constexpr float kInfinite = std::numeric_limits<float>::infinity();
// ln 2 in two parts: the first times a power of two has no rounding.
constexpr float kLog2High = 0.693359375f, kLog2Low = -2.12194440e-4f;

// Of x > 0, or infinite.
inline float log(float x) {
  const bool is_tiny = x < std::numeric_limits<float>::min();
  const float scaled = is_tiny ? x * 8388608.0f : x;
  // The mantissa lies between sqrt(1/2) and sqrt(2).
  const int32_t bits = bits_of(scaled), power = (bits - 0x3f3504f3) >> 23;
  const float f = of_bits(bits - power * (1 << 23)) - 1, z = f * f;
  const float e = float(power - (is_tiny ? 23 : 0));
  float y = 7.0376836292e-2f;
  y = y * f - 1.1514610310e-1f;
  y = y * f + 1.1676998740e-1f;
  y = y * f - 1.2420140846e-1f;
  y = y * f + 1.4249322787e-1f;
  y = y * f - 1.6668057665e-1f;
  y = y * f + 2.0000714765e-1f;
  y = y * f - 2.4999993993e-1f;
  y = y * f + 3.3333331174e-1f;
  y = y * f * z + kLog2Low * e - 0.5f * z;
  const float found = f + y + kLog2High * e;
  return x == kInfinite ? x : found;
}

// Of x <= 0, or NaN; 0 where that leaves float32's normal numbers.
inline float exp(float x) {
  const float least = -87.3f, kept = x < least ? least : x;
  const int32_t power = int32_t(kept * 1.44269504088896341f - 0.5f);
  const float n = float(power), r = kept - n * kLog2High - n * kLog2Low;
  float y = 1.9875691500e-4f;
  y = y * r + 1.3981999507e-3f;
  y = y * r + 8.3334519073e-3f;
  y = y * r + 4.1665795894e-2f;
  y = y * r + 1.6666665459e-1f;
  y = y * r + 5.0000001201e-1f;
  y = y * r * r + r + 1;
  const uint32_t scale = uint32_t(power + 127) << 23;
  return y * of_bits(x > least ? int32_t(scale) : 0);
}

}  // namespace elementary
