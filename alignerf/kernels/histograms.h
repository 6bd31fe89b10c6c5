// Resampling along a ray and the proposals' loss: the twin of
// alignerf/mipnerf360/stepfun.py, which has the words. A ray after the other, whose
// histograms stay in a core's first cache; sorted edges are gone through once.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "elementary.h"
#include "xla/ffi/api/ffi.h"

namespace histograms {

namespace ffi = xla::ffi;
using Array = ffi::Buffer<ffi::F32>;
using Result = ffi::ResultBuffer<ffi::F32>;

constexpr float kEps = std::numeric_limits<float>::epsilon();
constexpr float kInfinite = std::numeric_limits<float>::infinity();

inline float clipped(float x) { return std::min(std::max(x, 0.0f), 1.0f); }

// Room for what a ray needs: dilated edges, their mass, its distribution function.
struct Room {
  std::vector<float> low, high, density, edges, mass, cdf;

  explicit Room(int bins)
      : low(bins + 1), high(bins + 1), density(bins), edges(3 * bins + 1),
        mass(3 * bins + 1), cdf(3 * bins + 2) {}
};

// `max_dilate` of t [bins + 1], w [bins] to room.edges and room.mass; returns its bins.
inline int dilate(const float* t, const float* w, int bins, float dilation, Room& room) {
  for (int k = 0; k < bins; ++k) {
    const float width = t[k + 1] - t[k];
    room.low[k] = t[k] - dilation;
    room.high[k] = t[k + 1] + dilation;
    room.density[k] = width > kEps * kEps ? w[k] / width : 0.0f;
  }
  room.low[bins] = room.high[bins] = kInfinite;
  // All 3 bins + 1 edges in their order, the outermost dropped. Intervals from `ended` to
  // before `begun` cover what follows an edge; `most` is the largest of their densities.
  const int wide = 3 * bins - 2;
  float total = 0, length = 0, start = 0, most = 0;
  for (int j = -1, begun = 0, ended = 0, passed = 0; j <= wide; ++j) {
    const float x = room.low[begun], y = room.high[ended];
    const float z = passed <= bins ? t[passed] : kInfinite;
    const float least = std::min(std::min(x, y), z), edge = clipped(least);
    if (j > 0) {
      const float width = edge - start;
      total += room.mass[j - 1] = most * width;
      length += width;
    }
    if (x == least && begun < bins) {
      most = std::max(most, room.density[begun++]);
    } else if (y == least && ended < bins) {
      const float gone = room.density[ended++];
      if (gone == most) {
        most = 0;
        for (int k = ended; k < begun; ++k) most = std::max(most, room.density[k]);
      }
    } else {
      ++passed;
    }
    if (j >= 0) room.edges[j] = edge;
    start = edge;
  }
  for (int j = 0; j < wide; ++j) {
    const float width = room.edges[j + 1] - room.edges[j];
    room.mass[j] = total <= 0 ? width / length : room.mass[j] / total;
  }
  return wide;
}

// All of x, by eight at once: one after the other, each would wait for the one before.
template <typename Of>
inline float folded(const float* x, int count, float begin, Of of) {
  float lanes[8];
  std::fill(lanes, lanes + 8, begin);
  int k = 0;
  for (; k + 8 <= count; k += 8)
    for (int i = 0; i < 8; ++i) lanes[i] = of(lanes[i], x[k + i]);
  for (; k < count; ++k) lanes[k % 8] = of(lanes[k % 8], x[k]);
  for (int i = 1; i < 8; ++i) lanes[0] = of(lanes[0], lanes[i]);
  return lanes[0];
}

// `cdf_from_logits` of `annealed_logits`, to room.cdf [bins + 1].
inline void distribution(const float* t, const float* w, int bins, float anneal,
                         Room& room) {
  float* const __restrict logits = room.cdf.data() + 1;
  int any = 0;
  for (int k = 0; k < bins; ++k) any |= (t[k + 1] > t[k]) & (w[k] > 0);
  const bool all = !any | (anneal == 0);
  for (int k = 0; k < bins; ++k) {
    const bool weighs = w[k] > 0, counts = (t[k + 1] > t[k]) & (weighs | all);
    const float own = weighs ? anneal * elementary::log(w[k]) : 0.0f;
    logits[k] = counts ? own : -kInfinite;
  }
  const auto larger = [](float a, float b) { return a > b ? a : b; };
  const auto plus = [](float a, float b) { return a + b; };
  const float peak = folded(logits, bins, -kInfinite, larger);
  for (int k = 0; k < bins; ++k) logits[k] = elementary::exp(logits[k] - peak);
  const float share = 1 / folded(logits, bins, 0.0f, plus);
  float passed = 0;
  for (int k = 0; k < bins; ++k) logits[k] *= share;
  for (int k = 0; k < bins; ++k) logits[k] = passed += logits[k];
  for (int k = 0; k < bins; ++k) logits[k] = std::min(logits[k], 1.0f);
  room.cdf[0] = 0;
  room.cdf[bins] = 1;
}

// `sample_intervals` by room.cdf; jitter null: at the centres of equal shares.
inline void sample(const float* t, int bins, const float* jitter, int count,
                   const Room& room, float* edges) {
  const float* const cdf = room.cdf.data();
  const float most = kEps + (1 - kEps) / count;
  const float begin = jitter ? 0 : 0.5f / count;
  const float end = jitter ? 1 - most : 1 - 0.5f / count - kEps;
  const float more = jitter ? *jitter * (most - kEps) : 0;
  float first = 0, before = 0, middle = 0;
  for (int j = 0, k = 0; j < count; ++j) {
    const float step = count > 1 ? float(j) / float(count - 1) : 0;
    const float u = begin * (1 - step) + end * step + more;
    while (k + 1 < bins && cdf[k + 1] <= u) ++k;
    const float rise = cdf[k + 1] - cdf[k];
    const float share = rise == 0 ? 0.5f : clipped((u - cdf[k]) / rise);
    const float centre = t[k] + share * (t[k + 1] - t[k]);
    middle = (centre + before) / 2;
    if (j == 0) first = centre; else edges[j] = middle;
    if (j == 1) edges[0] = std::max(2 * first - middle, 0.0f);
    before = centre;
  }
  edges[count] = std::min(2 * before - middle, 1.0f);
  if (count == 1) edges[0] = 0, edges[1] = 1;
}

// dilation < 0: none. A NaN spoils its whole ray, and no other.
inline ffi::Error Resample(Array t, Array w, Array jitter, Array anneal, Result out,
                           float dilation, bool jittered) {
  const int64_t rays = t.dimensions()[0];
  const int bins = int(w.dimensions()[1]), count = int(out->dimensions()[1]) - 1;
  Room room(bins);
  for (int64_t ray = 0; ray < rays; ++ray) {
    const float* edges = t.typed_data() + ray * (bins + 1);
    const float* mass = w.typed_data() + ray * bins;
    float* to = out->typed_data() + ray * (count + 1);
    float sum = anneal.typed_data()[0];
    for (int k = 0; k < bins; ++k) sum += mass[k] + edges[k];
    if (std::isnan(sum + edges[bins])) {
      std::fill(to, to + count + 1, std::numeric_limits<float>::quiet_NaN());
      continue;
    }
    int found = bins;
    if (dilation >= 0) {
      found = dilate(edges, mass, bins, dilation, room);
      edges = room.edges.data();
      mass = room.mass.data();
    }
    distribution(edges, mass, found, anneal.typed_data()[0], room);
    sample(edges, found, jittered ? jitter.typed_data() + ray : nullptr, count, room, to);
  }
  return ffi::Error::Success();
}

// `interlevel_loss` of each ray, and its gradient in the proposal's weights.
inline ffi::Error Interlevel(Array t, Array w, Array t_other, Array w_other,
                             Result loss, Result grad) {
  const int64_t rays = t.dimensions()[0];
  const int bins = int(w.dimensions()[1]), others = int(w_other.dimensions()[1]);
  std::vector<float> passed(others + 1), slope(others + 1);
  for (int64_t ray = 0; ray < rays; ++ray) {
    const float* edges = t.typed_data() + ray * (bins + 1);
    const float* mass = w.typed_data() + ray * bins;
    const float* bounds = t_other.typed_data() + ray * (others + 1);
    const float* weights = w_other.typed_data() + ray * others;
    float* to = grad->typed_data() + ray * others;
    passed[0] = 0;
    for (int k = 0; k < others; ++k) passed[k + 1] = passed[k] + weights[k];
    std::fill(slope.begin(), slope.end(), 0.0f);
    float sum = 0;
    for (int k = 0, start = 0, end = 0; k < bins; ++k) {
      while (start < others && bounds[start + 1] <= edges[k]) ++start;
      while (end < others && bounds[end] < edges[k + 1]) ++end;
      const float missing = mass[k] - (passed[end] - passed[start]);
      // A NaN is not 0: it says that a training has failed.
      const float less = missing <= 0 ? 0 : missing, share = less / (mass[k] + kEps);
      sum += less * share;
      slope[end] -= 2 * share;
      slope[start] += 2 * share;
    }
    loss->typed_data()[ray] = sum;
    float run = 0;
    for (int k = others - 1; k >= 0; --k) to[k] = run += slope[k + 1];
  }
  return ffi::Error::Success();
}

}  // namespace histograms
