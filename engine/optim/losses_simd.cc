// SSIM of a tile and L1 of a row, a vector of pixels at a time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/optim/losses_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "engine/optim/losses_simd.h"

HWY_BEFORE_NAMESPACE();
namespace engine::optim {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t most_lanes = 16;  // rows of buffers are padded to this
using D = hn::CappedTag<float, most_lanes>;
using V = hn::Vec<D>;

/// A sum in double, so that it hardly depends on which lanes and rows the values come in.
class Sum {
 public:
  /// Adds values[0, n), n a multiple of most_lanes.
  HWY_INLINE void Add(const float* values, std::size_t n) {
    const hn::CappedTag<double, most_lanes / 2> d;
    const hn::Rebind<float, decltype(d)> narrow;
    auto sum = hn::Load(d, lanes_);
    for (std::size_t i = 0; i < n; i += hn::Lanes(d))
      sum = hn::Add(sum, hn::PromoteTo(d, hn::Load(narrow, values + i)));
    hn::Store(sum, d, lanes_);
  }
  HWY_INLINE double Total() const {
    double total = 0;
    for (const double lane : lanes_) total += lane;
    return total;
  }

 private:
  alignas(64) double lanes_[most_lanes / 2] = {};
};

constexpr int radius = 5, taps = 2 * radius + 1;

/// exp(-k^2 / (2 1.5^2)) for k = 5 .. 0, divided by the sum over the whole window.
constexpr float window[radius + 1] = {0.00102838008447911f, 0.007598758135239185f, 0.03600077212843083f,
                                      0.1093606895097f,     0.2130055377112537f,   0.26601172486179436f};

/// Weighted sum of eleven vectors, of which load(k) is the k-th.
template <class Load>
HWY_INLINE V Weighted(D d, Load load) {
  V even = hn::Mul(hn::Set(d, window[5]), load(5)),
    odd = hn::Mul(hn::Set(d, window[4]), hn::Add(load(4), load(6)));  // two chains: half the latency
  even = hn::MulAdd(hn::Set(d, window[3]), hn::Add(load(3), load(7)), even);
  odd = hn::MulAdd(hn::Set(d, window[2]), hn::Add(load(2), load(8)), odd);
  even = hn::MulAdd(hn::Set(d, window[1]), hn::Add(load(1), load(9)), even);
  odd = hn::MulAdd(hn::Set(d, window[0]), hn::Add(load(0), load(10)), odd);
  return hn::Add(even, odd);
}

// Columns of a tile's rows. Index 0 of a `wide` row is ten columns left of the tile, of a `middle` row five columns,
// of a `narrow` row none; so filtering a row along itself reads eleven values from the index it writes. The last
// vector of a row may compute more than is used, and the row it reads is longer by as much.
constexpr std::size_t narrow_stride = ssim_tile_width;
constexpr std::size_t middle_stride = ssim_tile_width + 32;
constexpr std::size_t wide_stride = ssim_tile_width + 64;
constexpr std::size_t ring_rows = 16;  // a power of two, at least `taps`

HWY_INLINE std::size_t RingRow(int row) { return std::size_t(row) & (ring_rows - 1); }

/// Rows filtered along x that still wait for being filtered along y.
template <std::size_t kQuantities, std::size_t kStride>
struct Ring {
  alignas(64) float rows[ring_rows][kQuantities][kStride];

  HWY_INLINE float* Row(int row, std::size_t quantity) { return rows[RingRow(row)][quantity]; }
  HWY_INLINE void Clear(int row) { std::memset(rows[RingRow(row)], 0, sizeof rows[0]); }
};

struct Buffers {
  // With s = x + y and d = x - y, so that what the loss is made of is computed from small numbers where the pictures
  // are close, and is exactly zero where they are equal.
  alignas(64) float s[wide_stride], d[wide_stride], ss[wide_stride], dd[wide_stride];
  Ring<4, middle_stride> means;  ///< Of s, d, s^2, d^2.
  alignas(64) float v_mean[middle_stride], v_dd[middle_stride], v_ss[middle_stride];
  Ring<3, narrow_stride> v;  ///< Of the three.
  /// 1 where the map counts: inside the picture and not masked; `own`: and inside the tile.
  alignas(64) float inside[middle_stride], inside_tile[middle_stride], keep[middle_stride], own[middle_stride];
  alignas(64) float row_v_mean[narrow_stride], row_v_dd[narrow_stride], row_v_ss[narrow_stride];
};

/// One channel and one tile of it. Only pixels within ten of the tile are read.
struct Tile {
  const SsimChannel& channel;
  scene::Rect rect;
  int width, height;  ///< Of the picture.
};

/// Columns [x0, x1) of the picture that lie within `reach` of the tile.
struct Columns {
  int x0, x1;
};
HWY_INLINE Columns Reach(const Tile& tile, int reach) {
  return {HWY_MAX(tile.rect.x0 - reach, 0), HWY_MIN(tile.rect.x1 + reach, tile.width)};
}

/// True if both pictures have the same bits wherever this tile looks: the loss and all its derivatives are zero.
HWY_INLINE bool PicturesAgree(const Tile& tile) {
  const Columns columns = Reach(tile, 2 * radius);
  const int y1 = HWY_MIN(tile.rect.y1 + 2 * radius, tile.height);
  for (int y = HWY_MAX(tile.rect.y0 - 2 * radius, 0); y < y1; ++y)
    if (std::memcmp(tile.channel.rendered.row(0, y) + columns.x0, tile.channel.target.row(0, y) + columns.x0,
                    std::size_t(columns.x1 - columns.x0) * sizeof(float)) != 0)
      return false;
  return true;
}

/// True if the map counts nowhere that matters to this tile.
HWY_INLINE bool AllMasked(const Tile& tile) {
  if (tile.channel.mask.data == nullptr) return false;
  const Columns columns = Reach(tile, radius);
  const int y1 = HWY_MIN(tile.rect.y1 + radius, tile.height);
  for (int y = HWY_MAX(tile.rect.y0 - radius, 0); y < y1; ++y)
    for (int x = columns.x0; x < columns.x1; ++x)
      if (tile.channel.mask.row(y)[x] == 0) return false;
  return true;
}

/// s, d, s^2 and d^2 of picture row y, filtered along x.
HWY_INLINE void FilterPictureRow(D d, const Tile& tile, int y, Buffers& b) {
  if (y < 0 || y >= tile.height) return b.means.Clear(y);
  const Columns columns = Reach(tile, 2 * radius);
  const auto first = std::size_t(columns.x0 - (tile.rect.x0 - 2 * radius)), n = std::size_t(columns.x1 - columns.x0);
  // Pictures end anywhere, and vectors do not: through copies, which are zero where no picture is.
  std::memcpy(b.s + first, tile.channel.rendered.row(0, y) + columns.x0, n * sizeof(float));
  std::memcpy(b.d + first, tile.channel.target.row(0, y) + columns.x0, n * sizeof(float));
  const auto used = std::size_t(tile.rect.width()) + 2 * radius;
  for (std::size_t i = 0; i < used + 2 * radius; i += hn::Lanes(d)) {
    const V x = hn::Load(d, b.s + i), t = hn::Load(d, b.d + i);
    const V s = hn::Add(x, t), diff = hn::Sub(x, t);
    hn::Store(s, d, b.s + i), hn::Store(diff, d, b.d + i);
    hn::Store(hn::Mul(s, s), d, b.ss + i), hn::Store(hn::Mul(diff, diff), d, b.dd + i);
  }
  const float* from[4] = {b.s, b.d, b.ss, b.dd};
  for (std::size_t q = 0; q < 4; ++q) {
    float* to = b.means.Row(y, q);
    for (std::size_t i = 0; i < used; i += hn::Lanes(d))
      hn::Store(Weighted(d, [&](std::size_t k) HWY_ATTR { return hn::LoadU(d, from[q] + i + k); }), d, to + i);
  }
  // Only the picture's own columns are written above; the next row must find zeros beside them again.
  std::memset(b.s, 0, first * sizeof(float)), std::memset(b.d, 0, first * sizeof(float));
  std::memset(b.s + first + n, 0, (wide_stride - first - n) * sizeof(float));
  std::memset(b.d + first + n, 0, (wide_stride - first - n) * sizeof(float));
}

/// Which pixels of map row y count.
HWY_INLINE void FindKept(const Tile& tile, int y, Buffers& b) {
  const std::uint8_t* mask = tile.channel.mask.data == nullptr ? nullptr : tile.channel.mask.row(y);
  const Columns columns = Reach(tile, radius);
  const bool owned = y >= tile.rect.y0 && y < tile.rect.y1;
  std::memcpy(b.keep, b.inside, sizeof b.keep);
  if (mask != nullptr) {
    float* keep = b.keep + (columns.x0 - (tile.rect.x0 - radius));
    for (int x = columns.x0; x < columns.x1; ++x) keep[x - columns.x0] = mask[x] == 0 ? 1.0f : 0.0f;
  }
  for (std::size_t i = 0; i < middle_stride; ++i) b.own[i] = owned ? b.keep[i] * b.inside_tile[i] : 0.0f;
}

/// The map at row y: adds its 1 - term to `sum`, and leaves in b.v what flows back to the means, filtered along x.
template <bool kFull>
HWY_INLINE void MapRow(D d, const Tile& tile, int y, Sum& sum, Buffers& b) {
  if (y < 0 || y >= tile.height) return b.v.Clear(y);
  FindKept(tile, y, b);
  const float* rows[taps];  // of s; those of d, s^2 and d^2 follow
  for (int k = 0; k < taps; ++k) rows[k] = b.means.Row(y - radius + k, 0);
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), half = hn::Set(d, 0.5f), two = hn::Set(d, 2.0f);
  const V c1 = hn::Set(d, 1e-4f), c2 = hn::Set(d, 9e-4f);
  const auto used = std::size_t(tile.rect.width()) + 2 * radius;
  for (std::size_t i = 0; i < used; i += hn::Lanes(d)) {
    auto mean = [&](std::size_t quantity) HWY_ATTR {
      return Weighted(d, [&](std::size_t k) HWY_ATTR { return hn::Load(d, rows[k] + quantity * middle_stride + i); });
    };
    const V mu_s = mean(0), mu_d = mean(1);
    // Rounding can make a variance negative; the derivative stays that of the formula.
    const V var_s = hn::Max(hn::NegMulAdd(mu_s, mu_s, mean(2)), zero);
    const V var_d = hn::Max(hn::NegMulAdd(mu_d, mu_d, mean(3)), zero);
    const V mu_d2 = hn::Mul(mu_d, mu_d);
    const V inverse_c = hn::Div(one, hn::MulAdd(half, hn::MulAdd(mu_s, mu_s, mu_d2), c1));
    const V inverse_d = hn::Div(one, hn::MulAdd(half, hn::Add(var_s, var_d), c2));
    const V a = hn::Mul(mu_d2, inverse_c), contrast_loss = hn::Mul(var_d, inverse_d);
    // loss = a + b - ab. p: derivative by mu_d^2 and mu_s^2 through a; q: by var_d and var_s through b.
    const V v_b = kFull ? hn::Sub(one, a) : one;
    const V counts = hn::Mul(hn::Load(d, b.keep + i), v_b);
    const V over_d = hn::Mul(counts, inverse_d);
    const V q_d = hn::Mul(over_d, hn::NegMulAdd(half, contrast_loss, one));
    const V q_s = hn::Neg(hn::Mul(over_d, hn::Mul(half, contrast_loss)));
    V along_d = hn::Neg(q_d), along_s = hn::Neg(q_s);
    V here = contrast_loss;
    if constexpr (kFull) {
      here = hn::MulAdd(a, hn::Sub(one, contrast_loss), contrast_loss);
      const V p = hn::Mul(hn::Mul(hn::Load(d, b.keep + i), hn::Sub(one, contrast_loss)), inverse_c);
      along_d = hn::MulAdd(p, hn::NegMulAdd(half, a, one), along_d);
      along_s = hn::NegMulAdd(p, hn::Mul(half, a), along_s);
    }
    hn::Store(hn::Mul(hn::Load(d, b.own + i), here), d, b.own + i);
    hn::Store(hn::Mul(two, hn::MulAdd(mu_d, along_d, hn::Mul(mu_s, along_s))), d, b.v_mean + i);
    hn::Store(q_d, d, b.v_dd + i);
    hn::Store(q_s, d, b.v_ss + i);
  }
  sum.Add(b.own, middle_stride);  // each 1 - term where it counts, else zero
  const float* from[3] = {b.v_mean, b.v_dd, b.v_ss};
  for (std::size_t q = 0; q < 3; ++q) {
    float* to = b.v.Row(y, q);
    for (std::size_t i = 0; i < std::size_t(tile.rect.width()); i += hn::Lanes(d))
      hn::Store(Weighted(d, [&](std::size_t k) HWY_ATTR { return hn::LoadU(d, from[q] + i + k); }), d, to + i);
  }
}

/// Adds the gradient of picture row y.
HWY_INLINE void GradientRow(D d, const Tile& tile, int y, Buffers& b) {
  const float* rows[taps];
  for (int k = 0; k < taps; ++k) rows[k] = b.v.Row(y - radius + k, 0);
  const auto n = std::size_t(tile.rect.width());
  float* to[3] = {b.row_v_mean, b.row_v_dd, b.row_v_ss};
  for (std::size_t q = 0; q < 3; ++q)
    for (std::size_t i = 0; i < n; i += hn::Lanes(d))
      hn::Store(Weighted(d, [&](std::size_t k) HWY_ATTR { return hn::Load(d, rows[k] + q * narrow_stride + i); }), d,
                to[q] + i);
  const float* x = tile.channel.rendered.row(0, y) + tile.rect.x0;
  const float* t = tile.channel.target.row(0, y) + tile.rect.x0;
  float* v = tile.channel.v_rendered.row(0, y) + tile.rect.x0;
  const float scale = tile.channel.scale;
  for (std::size_t i = 0; i < n; ++i)
    v[i] += scale * (b.row_v_mean[i] + 2.0f * ((x[i] - t[i]) * b.row_v_dd[i] + (x[i] + t[i]) * b.row_v_ss[i]));
}

template <bool kFull>
double Ssim(const SsimChannel& channel, scene::Rect rect) {
  const D d;
  const Tile tile{channel, rect, channel.rendered.width, channel.rendered.height};
  if (AllMasked(tile) || PicturesAgree(tile)) return 0;
  Buffers b;
  for (float* row : {b.s, b.d, b.ss, b.dd}) std::fill_n(row, wide_stride, 0.0f);
  for (int i = 0; i < int(middle_stride); ++i) {
    const int x = rect.x0 - radius + i;
    b.inside[i] = x >= 0 && x < tile.width && x < rect.x1 + radius ? 1.0f : 0.0f;
    b.inside_tile[i] = x >= rect.x0 && x < rect.x1 ? 1.0f : 0.0f;
  }
  for (float* row : {b.v_mean, b.v_dd, b.v_ss}) std::fill_n(row, middle_stride, 0.0f);
  Sum sum;
  for (int y = rect.y0 - 2 * radius; y < rect.y1 + 2 * radius; ++y) {
    FilterPictureRow(d, tile, y, b);
    if (y < rect.y0) continue;
    MapRow<kFull>(d, tile, y - radius, sum, b);
    if (y >= rect.y0 + 2 * radius) GradientRow(d, tile, y - 2 * radius, b);
  }
  return sum.Total();
}

double SsimTile(const SsimChannel& channel, SsimTerm term, scene::Rect rect) {
  return term == SsimTerm::full ? Ssim<true>(channel, rect) : Ssim<false>(channel, rect);
}

template <SmoothL1 kKind>
HWY_INLINE V L1(D d, V x, V t, V scale, V slope, V& gradient) {
  const V difference = hn::Sub(x, t);
  if constexpr (kKind == SmoothL1::charbonnier) {
    // sqrt(d^2 + e^2) - e = d^2 / (sqrt(d^2 + e^2) + e): keeps the digits of small differences.
    const V square = hn::Mul(difference, difference);
    const V root = hn::Sqrt(hn::MulAdd(scale, scale, square));
    gradient = hn::Mul(slope, hn::Div(difference, root));
    return hn::Div(square, hn::Add(root, scale));
  }
  const V beyond = hn::Sub(hn::Abs(difference), scale);
  const auto counts = hn::Gt(beyond, hn::Zero(d));
  gradient = hn::IfThenElseZero(counts, hn::Mul(slope, hn::CopySign(hn::Set(d, 1.0f), difference)));
  return hn::IfThenElseZero(counts, beyond);
}

template <SmoothL1 kKind>
double L1Row(const float* rendered, const float* target, const std::uint8_t* mask, std::size_t n, float scale,
             float slope, float* v) {
  const D d;
  const V scales = hn::Set(d, scale), slopes = hn::Set(d, slope);
  constexpr std::size_t block = 64;  // through copies, as in FilterPictureRow()
  alignas(64) float x[block], t[block], keep[block];
  Sum sum;
  for (std::size_t begin = 0; begin < n; begin += block) {
    const std::size_t count = HWY_MIN(block, n - begin);
    if (count < block) {
      std::fill_n(x, block, 0.0f), std::fill_n(t, block, 0.0f), std::fill_n(keep, block, 0.0f);
    }
    std::memcpy(x, rendered + begin, count * sizeof(float));
    std::memcpy(t, target + begin, count * sizeof(float));
    for (std::size_t i = 0; i < count; ++i) keep[i] = mask == nullptr || mask[begin + i] == 0 ? 1.0f : 0.0f;
    for (std::size_t i = 0; i < block; i += hn::Lanes(d)) {
      V gradient = hn::Zero(d);
      const V counts = hn::Load(d, keep + i);
      const V loss = L1<kKind>(d, hn::Load(d, x + i), hn::Load(d, t + i), scales, slopes, gradient);
      hn::Store(hn::Mul(counts, loss), d, t + i);
      hn::Store(hn::Mul(counts, gradient), d, x + i);
    }
    sum.Add(t, block);
    for (std::size_t i = 0; i < count; ++i) v[begin + i] += x[i];
  }
  return sum.Total();
}

double SmoothL1Row(const float* rendered, const float* target, const std::uint8_t* mask, int n, SmoothL1 kind,
                   float scale, float slope, float* v) {
  return kind == SmoothL1::charbonnier
             ? L1Row<SmoothL1::charbonnier>(rendered, target, mask, std::size_t(n), scale, slope, v)
             : L1Row<SmoothL1::dead_zone>(rendered, target, mask, std::size_t(n), scale, slope, v);
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::optim
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::optim {

HWY_EXPORT(SsimTile);
HWY_EXPORT(SmoothL1Row);

double ssim_tile(const SsimChannel& channel, SsimTerm term, scene::Rect tile) {
  return HWY_DYNAMIC_DISPATCH(SsimTile)(channel, term, tile);
}

double smooth_l1_row(const float* rendered, const float* target, const std::uint8_t* mask, int n, SmoothL1 kind,
                     float scale, float slope, float* v) {
  return HWY_DYNAMIC_DISPATCH(SmoothL1Row)(rendered, target, mask, n, kind, scale, slope, v);
}

}  // namespace engine::optim
#endif
