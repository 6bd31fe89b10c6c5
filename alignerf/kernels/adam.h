// Adam on a hash grid's table, whose untouched entries rest: the twin of
// alignerf/training/step.py, in one pass instead of a dozen.
#pragma once

#include <cmath>

#include "xla/ffi/api/ffi.h"

namespace adam {

namespace ffi = xla::ffi;
using Array = ffi::Buffer<ffi::F32>;
using Result = ffi::ResultBuffer<ffi::F32>;

// Of a step: the learning rate, 1 - beta^t of both moments, beta and 1 - beta.
struct Numbers {
  float rate, share_1, share_2, beta_1, beta_2, rest_1, rest_2, eps;
};

// Moments in place: mu_out and nu_out may be mu and nu, and are read before.
inline void update(const Numbers of, int64_t count, const float* __restrict grad,
                   const float* mu, const float* nu, float* __restrict step,
                   float* mu_out, float* nu_out) {
#if defined(__clang__)
#pragma clang loop vectorize(assume_safety)
#elif defined(__GNUC__)
#pragma GCC ivdep
#endif
  for (int64_t i = 0; i < count; ++i) {
    const float g = grad[i], m = mu[i], v = nu[i];
    const float m_new = of.beta_1 * m + of.rest_1 * g;
    const float v_new = of.beta_2 * v + of.rest_2 * (g * g);
    const float root = std::sqrt(v_new / of.share_2) + of.eps;
    const float own = -of.rate * (m_new / of.share_1 / root);
    const bool rests = g == 0;
    step[i] = rests ? 0.0f : own;
    mu_out[i] = rests ? m : m_new;
    nu_out[i] = rests ? v : v_new;
  }
}

inline ffi::Error Update(Array grad, Array mu, Array nu, Array scales, Result step,
                         Result mu_out, Result nu_out, float beta_1, float beta_2,
                         float rest_1, float rest_2, float eps) {
  const float* scale = scales.typed_data();
  const Numbers of{scale[0], scale[1], scale[2], beta_1, beta_2, rest_1, rest_2, eps};
  update(of, int64_t(grad.element_count()), grad.typed_data(), mu.typed_data(),
         nu.typed_data(), step->typed_data(), mu_out->typed_data(),
         nu_out->typed_data());
  return ffi::Error::Success();
}

}  // namespace adam
