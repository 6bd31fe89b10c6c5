// 3D Gaussian splatting's rasteriser (Kerbl et al., 2023, arXiv 2308.04079) on a CPU.
//
// Notation: camera axes are OpenCV's; pixel centres lie at +0.5; a tile is 16 x 16 px.
// Sigma is a Gaussian's exponent, positive: alpha = opacity exp(-sigma). Its covariance
// on the screen, dilated, is (a, b; b, c) px^2, and sigma = (u^2 + v^2) / 2 with
// u = uu dx + uv dy and v = vv dy, Cholesky's factor of the inverse: a sum of squares
// keeps the digits that the product form loses far from the centre of a long Gaussian.
//
// Memory grows with the Gaussians alone, whatever the overdraw: a thread keeps one list,
// of the Gaussians on its row of tiles, and no tile has a list of its own. Each output
// is written by one piece of work alone, so that bits do not depend on the threads.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#include "../kernels/elementary.h"

namespace {

constexpr int kTile = 16, kBlock = 8192;
constexpr float kLeastAlpha = 1.0f / 255, kLeastTransmittance = 1e-4f;
// Further from the picture, in px, and further away, float32 has no pixels left.
constexpr double kFarPx = 1e9, kFar = 1e30;
constexpr float kMostColour = 1e30f;
// Slack in sigma and px of what is skipped early: rounding must not decide.
constexpr float kSlack = 1e-3f;
constexpr double kSlackPx = 0.1;

struct Gaussians {
  int64_t count;
  int32_t coefficients;
  const float *means, *scales, *quaternions, *opacities, *sh;
};

// rotation and translation: world to camera.
struct View {
  double rotation[9], translation[3], fx, fy, cx, cy, near, dilation_px2;
  float max_alpha, background[3];
  int32_t width, height, antialiased, threads;
};

// A Gaussian on the screen; limit: the largest sigma whose alpha still counts.
struct Splat {
  float x, y, uu, uv, vv, opacity, limit, colour[3], z;
};

// The tiles that it touches; ends are not among them.
struct Rectangle {
  uint16_t x, x_end, y, y_end;
  uint32_t index;
};

// work(i) for all i < count; false where memory ran out.
template <class Work>
bool parallel(int threads, int64_t count, Work work) {
  std::atomic<int64_t> next{0};
  std::atomic<bool> failed{false};
  const auto run = [&] {
    try {
      for (int64_t i; !failed && (i = next++) < count;) work(i);
    } catch (const std::bad_alloc&) {
      failed = true;
    }
  };
  std::vector<std::thread> others;
  others.reserve(threads);
  try {
    while (int64_t(others.size()) + 1 < std::min<int64_t>(threads, count))
      others.emplace_back(run);
  } catch (const std::system_error&) {
    // As many as the system allows.
  }
  run();
  for (auto& other : others) other.join();
  return !failed;
}

// Real spherical harmonics up to degree 3 of a unit direction: 3DGS's signs and order.
void harmonics(float x, float y, float z, float* basis) {
  const float xx = x * x, yy = y * y, zz = z * z;
  const float all[16] = {0.28209479f,
                         -0.48860251f * y,
                         0.48860251f * z,
                         -0.48860251f * x,
                         1.09254843f * x * y,
                         -1.09254843f * y * z,
                         0.31539157f * (2 * zz - xx - yy),
                         -1.09254843f * x * z,
                         0.54627422f * (xx - yy),
                         -0.59004359f * y * (3 * xx - yy),
                         2.89061144f * x * y * z,
                         -0.45704580f * y * (4 * zz - xx - yy),
                         0.37317633f * z * (2 * zz - 3 * xx - 3 * yy),
                         -0.45704580f * x * (4 * zz - xx - yy),
                         1.44530572f * z * (xx - yy),
                         -0.59004359f * x * (xx - 3 * yy)};
  std::copy(all, all + 16, basis);
}

// 0.5 more than the sum, not negative; NaN becomes 0.
void shade(const Gaussians& from, int64_t i, const double* direction, float* colour) {
  const double length = std::hypot(direction[0], direction[1], direction[2]);
  float basis[16];
  harmonics(float(direction[0] / length), float(direction[1] / length),
            float(direction[2] / length), basis);
  const float* sh = from.sh + i * from.coefficients * 3;
  for (int channel = 0; channel < 3; ++channel) {
    float sum = 0.5f;
    for (int k = 0; k < from.coefficients; ++k) sum += basis[k] * sh[3 * k + channel];
    colour[channel] = std::min(kMostColour, std::max(0.0f, sum));
  }
}

// Whether Gaussian i is seen, and then where and how. In double precision: squares of
// scales, and of these the determinant, leave the range of float32.
bool project(const Gaussians& from, const View& view, int64_t i, Splat& splat,
             Rectangle& tiles) {
  const double* r = view.rotation;
  const float* mean = from.means + 3 * i;
  double at[3];
  for (int k = 0; k < 3; ++k)
    at[k] = r[3 * k] * mean[0] + r[3 * k + 1] * mean[1] + r[3 * k + 2] * mean[2] +
            view.translation[k];
  const double z = at[2];
  if (!(z > view.near && z < kFar)) return false;
  const double x = view.fx * at[0] / z + view.cx, y = view.fy * at[1] / z + view.cy;
  if (!(std::abs(x) < kFarPx && std::abs(y) < kFarPx)) return false;
  // The Jacobian is that of a place at most 0.15 of the picture beside it: further out
  // it blows Gaussians up. With a centred principal point it is 3DGS's 1.3 of the FOV.
  const double w = view.width, h = view.height;
  const double tan_x = std::clamp(at[0] / z, -(view.cx + 0.15 * w) / view.fx,
                                  (1.15 * w - view.cx) / view.fx);
  const double tan_y = std::clamp(at[1] / z, -(view.cy + 0.15 * h) / view.fy,
                                  (1.15 * h - view.cy) / view.fy);
  const float* q = from.quaternions + 4 * i;
  const double norm = std::sqrt(double(q[0]) * q[0] + double(q[1]) * q[1] +
                                double(q[2]) * q[2] + double(q[3]) * q[3]);
  const double unit = norm > 0 ? 1 / norm : 0;
  const double qw = q[0] * unit, qx = q[1] * unit, qy = q[2] * unit, qz = q[3] * unit;
  const double turn[9] = {1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qw * qz),
                          2 * (qx * qz + qw * qy),     2 * (qx * qy + qw * qz),
                          1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qw * qx),
                          2 * (qx * qz - qw * qy),     2 * (qy * qz + qw * qx),
                          1 - 2 * (qx * qx + qy * qy)};
  // The axes of the ellipsoid on the screen, m[0] across and m[1] down.
  double m[2][3];
  for (int k = 0; k < 3; ++k) {
    double axis[3];
    for (int row = 0; row < 3; ++row)
      axis[row] = r[3 * row] * turn[k] + r[3 * row + 1] * turn[3 + k] +
                  r[3 * row + 2] * turn[6 + k];
    const double scale = from.scales[3 * i + k] / z;
    m[0][k] = view.fx * scale * (axis[0] - tan_x * axis[2]);
    m[1][k] = view.fy * scale * (axis[1] - tan_y * axis[2]);
  }
  double a = 0, b = 0, c = 0, sharp = 0;
  for (int k = 0; k < 3; ++k) {
    const int l = (k + 1) % 3;
    const double cross = m[0][k] * m[1][l] - m[0][l] * m[1][k];
    a += m[0][k] * m[0][k];
    b += m[0][k] * m[1][k];
    c += m[1][k] * m[1][k];
    sharp += cross * cross;
  }
  // Determinants as sums: ac - b^2 of a thin Gaussian would be rounding alone.
  const double more = view.dilation_px2, det = sharp + more * (a + c) + more * more;
  a += more;
  c += more;
  const double share = view.antialiased ? std::sqrt(sharp / det) : 1;
  splat.opacity = float(from.opacities[i] * share);
  if (!(std::isfinite(det) && splat.opacity >= kLeastAlpha)) return false;
  const double limit = std::log(255.0 * splat.opacity) + kSlack;
  // 3DGS cuts off at 3 standard deviations of the longer axis.
  const double half = (a - c) / 2;
  const double longest = (a + c) / 2 + std::sqrt(std::max(0.1, half * half + b * b));
  const double radius = std::ceil(3 * std::sqrt(longest));
  const double rx = std::min(radius, std::sqrt(2 * limit * a) + kSlackPx);
  const double ry = std::min(radius, std::sqrt(2 * limit * c) + kSlackPx);
  const auto tile = [](double px, double side, bool end) {
    const double last = std::ceil(side / kTile), place = px / kTile;
    return uint16_t(std::clamp(end ? std::ceil(place) : std::floor(place), 0.0, last));
  };
  tiles = {tile(x - rx, w, false), tile(x + rx, w, true), tile(y - ry, h, false),
           tile(y + ry, h, true), uint32_t(i)};
  if (tiles.x >= tiles.x_end || tiles.y >= tiles.y_end) return false;
  splat.x = float(x);
  splat.y = float(y);
  splat.uu = float(std::sqrt(c / det));
  splat.uv = float(-b / std::sqrt(c * det));
  splat.vv = float(1 / std::sqrt(c));
  splat.limit = float(limit);
  splat.z = float(z);
  // From the camera's centre, in the world.
  double direction[3];
  for (int k = 0; k < 3; ++k)
    direction[k] = r[k] * at[0] + r[3 + k] * at[1] + r[6 + k] * at[2];
  shade(from, i, direction, splat.colour);
  return true;
}

// Indices in order of depth; equal depths stay as they are. Radix sort: the bits of
// positive floats are in their order.
void sort_by_depth(const Splat* splats, std::vector<Rectangle>& seen) {
  std::vector<Rectangle> other(seen.size());
  for (int shift = 0; shift < 32; shift += 11) {
    const auto digit = [&](const Rectangle& one) {
      return uint32_t(elementary::bits_of(splats[one.index].z)) >> shift & 2047;
    };
    std::vector<size_t> begins(2049);
    for (const auto& one : seen) ++begins[digit(one) + 1];
    for (int i = 0; i < 2048; ++i) begins[i + 1] += begins[i];
    for (const auto& one : seen) other[begins[digit(one)]++] = one;
    seen.swap(other);
  }
}

// The pixels of a tile, row by row, while Gaussians are laid over them front to back.
struct Tile {
  static constexpr int kPixels = kTile * kTile;
  float transmittance[kPixels], colour[3][kPixels] = {}, depth[kPixels] = {};
  int32_t live[kPixels];

  Tile() {
    std::fill_n(transmittance, kPixels, 1.0f);
    std::fill_n(live, kPixels, 1);
  }

  // Whether any pixel still takes something.
  bool lives() const { return std::count(live, live + kPixels, 1) > 0; }

  // x, y: of the first pixel's centre.
  void lay(const Splat& splat, float x, float y, float max_alpha) {
    for (int row = 0; row < kTile; ++row) {
      const float dy = y + row - splat.y, v = splat.vv * dy;
      const float rest = splat.limit - 0.5f * v * v;
      const float first = splat.uu * (x - splat.x) + splat.uv * dy;
      const float last = first + splat.uu * (kTile - 1);
      const float least = first > 0 ? first : last < 0 ? last : 0;
      if (rest < 0 || 0.5f * least * least > rest) continue;
      lay_row(splat, first, 0.5f * v * v, max_alpha, kTile * row);
    }
  }

  void lay_row(const Splat& splat, float first, float half_vv, float max_alpha,
               int begins) {
    float* __restrict through = transmittance + begins;
    float* __restrict red = colour[0] + begins;
    float* __restrict green = colour[1] + begins;
    float* __restrict blue = colour[2] + begins;
    float* __restrict far = depth + begins;
    int32_t* __restrict alive = live + begins;
    for (int i = 0; i < kTile; ++i) {
      const float u = first + splat.uu * i;
      const float raw = splat.opacity * elementary::exp(-(0.5f * u * u + half_vv));
      const float alpha = raw < max_alpha ? raw : max_alpha;
      const float after = through[i] * (1 - alpha);
      const int32_t counts = (alpha >= kLeastAlpha) & alive[i];
      const int32_t ends = counts & (after < kLeastTransmittance);
      const float weight = counts > ends ? alpha * through[i] : 0.0f;
      red[i] += weight * splat.colour[0];
      green[i] += weight * splat.colour[1];
      blue[i] += weight * splat.colour[2];
      far[i] += weight * splat.z;
      through[i] = counts > ends ? after : through[i];
      alive[i] = alive[i] & ~ends;
    }
  }
};

// Images of a view, row by row: colour [h, w, 3], alpha and depth [h, w].
struct Images {
  float *colour, *alpha, *depth;

  void write(const Tile& tile, const View& view, int x, int y) const {
    for (int row = 0; row < std::min(kTile, view.height - y); ++row)
      for (int i = 0; i < std::min(kTile, view.width - x); ++i) {
        const int from = kTile * row + i;
        const int64_t to = int64_t(view.width) * (y + row) + x + i;
        const float through = tile.transmittance[from];
        for (int k = 0; k < 3; ++k)
          colour[3 * to + k] = tile.colour[k][from] + through * view.background[k];
        alpha[to] = 1 - through;
        depth[to] = through < 1 ? tile.depth[from] / (1 - through) : 0;
      }
  }
};

void render_row(const View& view, const Splat* splats,
                const std::vector<Rectangle>& sorted, int row, const Images& images) {
  std::vector<Rectangle> here;
  for (const auto& one : sorted)
    if (one.y <= row && row < one.y_end) here.push_back(one);
  for (int column = 0; kTile * column < view.width; ++column) {
    const int x = kTile * column, y = kTile * row;
    Tile tile;
    int laid = 0;
    for (const auto& one : here) {
      if (column < one.x || column >= one.x_end) continue;
      tile.lay(splats[one.index], x + 0.5f, y + 0.5f, view.max_alpha);
      if (++laid % 16 == 0 && !tile.lives()) break;
    }
    images.write(tile, view, x, y);
  }
}

}  // namespace

// 0, or 1 where memory ran out.
extern "C" int32_t alignerf_rasterize(const Gaussians* from, const View* view,
                                      float* colour, float* alpha, float* depth) {
  try {
    const std::unique_ptr<Splat[]> splats(new Splat[from->count]);
    const int64_t blocks = (from->count + kBlock - 1) / kBlock;
    std::vector<std::vector<Rectangle>> found(blocks);
    const bool projected = parallel(view->threads, blocks, [&](int64_t block) {
      const int64_t end = std::min(from->count, (block + 1) * kBlock);
      for (int64_t i = block * kBlock; i < end; ++i) {
        Rectangle tiles;
        if (project(*from, *view, i, splats[i], tiles)) found[block].push_back(tiles);
      }
    });
    if (!projected) return 1;
    std::vector<Rectangle> seen;
    for (auto& block : found) seen.insert(seen.end(), block.begin(), block.end());
    sort_by_depth(splats.get(), seen);
    const Images images{colour, alpha, depth};
    const int rows = (view->height + kTile - 1) / kTile;
    const bool rendered = parallel(view->threads, rows, [&](int64_t row) {
      render_row(*view, splats.get(), seen, int(row), images);
    });
    return rendered ? 0 : 1;
  } catch (const std::bad_alloc&) {
    return 1;
  }
}
