// Interpolation in a grid's table, weighted, and its gradients: the twin of
// alignerf/fields/grid.py, which has the words. Points come in blocks: what a level
// needs of a block stays in a core's first cache.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "xla/ffi/api/ffi.h"

namespace lookup {

namespace ffi = xla::ffi;
using Array = ffi::Buffer<ffi::F32>;
using Result = ffi::ResultBuffer<ffi::F32>;
using Counts = ffi::Span<const int32_t>;

constexpr int kBlock = 64, kCorners = 8;
constexpr uint32_t kPrimes[3] = {1u, 2654435761u, 805459861u};

struct Level {
  int32_t cells;    // along an axis
  uint32_t mask;    // of a hashed row
  int32_t offset;   // of its first row in the table
  bool dense;       // its corners have a row each
  uint32_t stride[3];
};

inline std::vector<Level> levels_of(Counts resolutions, Counts entries) {
  std::vector<Level> levels;
  int32_t offset = 0;
  for (size_t number = 0; number < resolutions.size(); ++number) {
    const int64_t side = int64_t{resolutions[number]} + 1;
    const bool dense = side * side * side <= entries[number];
    Level level{resolutions[number], uint32_t(entries[number]) - 1, offset, dense, {}};
    int64_t stride = 1;
    for (int axis = 0; axis < 3; ++axis, stride *= side)
      level.stride[axis] = dense ? uint32_t(stride) : kPrimes[axis];
    levels.push_back(level);
    offset += entries[number];
  }
  return levels;
}

// Of a block's points: the rows of their cells' corners, and the corners' weights. Bit
// `axis` of a corner, from the highest, is its end along that axis.
struct Block {
  int32_t rows[kCorners][kBlock];
  float weights[kCorners][kBlock];
  float share[3][2][kBlock];  // of a cell's ends along each axis

  // points [3, n]; of these `count` from `start` on.
  void fill(const Level& level, const float* points, int64_t n, int64_t start,
            int count) {
    uint32_t part[3][2][kBlock];
    const float cells = float(level.cells);
    for (int axis = 0; axis < 3; ++axis) {
      const float* at = points + axis * n + start;
      const uint32_t stride = level.stride[axis];
      for (int i = 0; i < count; ++i) {
        const float scaled = at[i] * cells;
        // In this order a NaN gives 0, as in XLA; its share is NaN.
        const int32_t cell = int32_t(std::min(std::max(0.0f, scaled), cells - 1));
        share[axis][1][i] = scaled - float(cell);
        share[axis][0][i] = 1.0f - share[axis][1][i];
        part[axis][0][i] = uint32_t(cell) * stride;
        part[axis][1][i] = part[axis][0][i] + stride;
      }
    }
    for (int corner = 0; corner < kCorners; ++corner) {
      const int ends[3] = {corner >> 2, (corner >> 1) & 1, corner & 1};
      const uint32_t *x = part[0][ends[0]], *y = part[1][ends[1]], *z = part[2][ends[2]];
      const float *a = share[0][ends[0]], *b = share[1][ends[1]], *c = share[2][ends[2]];
      if (level.dense)
        for (int i = 0; i < count; ++i)
          rows[corner][i] = level.offset + int32_t(x[i] + y[i] + z[i]);
      else
        for (int i = 0; i < count; ++i)
          rows[corner][i] = level.offset + int32_t((x[i] ^ y[i] ^ z[i]) & level.mask);
      for (int i = 0; i < count; ++i) weights[corner][i] = a[i] * b[i] * c[i];
    }
  }
};

// Features [levels * features, n] of table [rows, features]; kFeatures 0: any number.
template <int kFeatures>
void forward(const float* table, const float* points, const float* share, float* out,
             int64_t n, int features, const std::vector<Level>& levels) {
  const int width = kFeatures ? kFeatures : features;
  Block block;
  std::vector<float> found(size_t(kBlock) * width);
  for (int64_t start = 0; start < n; start += kBlock) {
    const int count = int(std::min<int64_t>(kBlock, n - start));
    for (size_t number = 0; number < levels.size(); ++number) {
      block.fill(levels[number], points, n, start, count);
      for (int i = 0; i < count; ++i) {
        float* sum = found.data() + i * width;
        for (int f = 0; f < width; ++f) sum[f] = 0;
        for (int corner = 0; corner < kCorners; ++corner) {
          const float* row = table + int64_t{block.rows[corner][i]} * width;
          const float weight = block.weights[corner][i];
          for (int f = 0; f < width; ++f) sum[f] += weight * row[f];
        }
      }
      const float* own = share + number * n + start;
      for (int f = 0; f < width; ++f) {
        float* to = out + (int64_t(number) * width + f) * n + start;
        for (int i = 0; i < count; ++i) to[i] = found[i * width + f] * own[i];
      }
    }
  }
}

// Adds to the gradient of a point along an axis how its corners' weights change there;
// along [corners]: what the corners' features and the incoming gradient have in common.
inline void slopes(const Block& block, int axis, const float (*along)[kBlock],
                   const float* scale, float* to, int count) {
  const int bit = 4 >> axis, first = axis == 0 ? 1 : 0, second = axis == 2 ? 1 : 2;
  for (int corner = 0; corner < kCorners; ++corner) {
    if (corner & bit) continue;
    const float* a = block.share[first][(corner & (4 >> first)) != 0];
    const float* b = block.share[second][(corner & (4 >> second)) != 0];
    const float *low = along[corner], *high = along[corner | bit];
    for (int i = 0; i < count; ++i) to[i] += a[i] * b[i] * (high[i] - low[i]) * scale[i];
  }
}

// Adds to the table's gradient, level after level: its rows stay in the caches. With a
// table, to the gradients of the points [3, n] and of their share [levels, n] too.
template <int kFeatures>
void backward(const float* points, const float* share, const float* grad, float* out,
              int64_t n, int features, const std::vector<Level>& levels,
              const float* table, float* of_points, float* of_share) {
  const int width = kFeatures ? kFeatures : features;
  Block block;
  float along[kCorners][kBlock], scale[kBlock];
  std::vector<float> own(size_t(kBlock) * width);
  for (size_t number = 0; number < levels.size(); ++number)
    for (int64_t start = 0; start < n; start += kBlock) {
      const int count = int(std::min<int64_t>(kBlock, n - start));
      block.fill(levels[number], points, n, start, count);
      const float* part = share + number * n + start;
      for (int f = 0; f < width; ++f) {
        const float* from = grad + (int64_t(number) * width + f) * n + start;
        for (int i = 0; i < count; ++i) own[i * width + f] = from[i];
      }
      if (table) {
        for (int i = 0; i < count; ++i)
          for (int corner = 0; corner < kCorners; ++corner) {
            const float* row = table + int64_t{block.rows[corner][i]} * width;
            float sum = 0;
            for (int f = 0; f < width; ++f) sum += row[f] * own[i * width + f];
            along[corner][i] = sum;
          }
        float* to = of_share + number * n + start;
        for (int i = 0; i < count; ++i) scale[i] = part[i] * float(levels[number].cells);
        for (int corner = 0; corner < kCorners; ++corner)
          for (int i = 0; i < count; ++i)
            to[i] += block.weights[corner][i] * along[corner][i];
        for (int axis = 0; axis < 3; ++axis)
          slopes(block, axis, along, scale, of_points + axis * n + start, count);
      }
      for (int i = 0; i < count; ++i) {
        for (int f = 0; f < width; ++f) own[i * width + f] *= part[i];
        for (int corner = 0; corner < kCorners; ++corner) {
          float* row = out + int64_t{block.rows[corner][i]} * width;
          const float weight = block.weights[corner][i];
          for (int f = 0; f < width; ++f) row[f] += weight * own[i * width + f];
        }
      }
    }
}

inline ffi::Error Forward(Array table, Array points, Array share, Result out,
                          Counts resolutions, Counts entries) {
  const auto levels = levels_of(resolutions, entries);
  const int features = int(table.dimensions()[1]);
  const auto kernel =
      features == 4 ? forward<4> : features == 2 ? forward<2> : forward<0>;
  kernel(table.typed_data(), points.typed_data(), share.typed_data(), out->typed_data(),
         points.dimensions()[1], features, levels);
  return ffi::Error::Success();
}

// of_points and of_share are empty where the points stay.
inline ffi::Error Backward(Array table, Array points, Array share, Array grad, Result out,
                           Result of_points, Result of_share, Counts resolutions,
                           Counts entries) {
  const auto levels = levels_of(resolutions, entries);
  const int features = int(out->dimensions()[1]);
  const bool moving = of_points->element_count() > 0;
  for (Result* made : {&out, &of_points, &of_share})
    std::fill_n((*made)->typed_data(), (*made)->element_count(), 0.0f);
  const auto kernel =
      features == 4 ? backward<4> : features == 2 ? backward<2> : backward<0>;
  kernel(points.typed_data(), share.typed_data(), grad.typed_data(), out->typed_data(),
         points.dimensions()[1], features, levels, moving ? table.typed_data() : nullptr,
         of_points->typed_data(), of_share->typed_data());
  return ffi::Error::Success();
}

}  // namespace lookup
