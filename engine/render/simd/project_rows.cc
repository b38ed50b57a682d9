// The projection of project.h, a vector of Gaussians at a time.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/project_rows.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: the math functions are compiled once per instruction set.
#include <hwy/contrib/math/math-inl.h>

#include "engine/render/simd/shade_rows.inc"

#include <algorithm>

#include "engine/render/splats.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::ScalableTag<float>;
using V = hn::Vec<D>;

/// Survivors of a block, one array per field, before their colours are known.
struct Survivors {
  static constexpr std::size_t room = project_block + 64;  // whole vectors are stored
  alignas(64) float x[room], y[room], depth[room], l1[room], l2[room], l3[room], log2_opacity[room];
  alignas(64) float to_x[room], to_y[room], to_z[room];           // unit direction from the camera centre
  alignas(64) std::int32_t row[room], columns[room], rows[room];  // tiles: first | last << 16
  std::size_t count = 0;
};

HWY_INLINE V Load(D d, const float* from, std::size_t n) {
  if (n >= hn::Lanes(d)) return hn::LoadU(d, from);
  alignas(64) float padded[hn::MaxLanes(D())] = {};  // not MaskedLoad(): with SSE it reads the whole vector
  std::copy_n(from, n, padded);
  return hn::Load(d, padded);
}

struct Axes {
  V xx, xy, xz, yx, yy, yz, zx, zy, zz;  // row, column
};

/// rotation_matrix() of project.h.
HWY_INLINE Axes RotationMatrix(D d, V w, V x, V y, V z) {
  const V largest =
      hn::Max(hn::Max(hn::Max(hn::Abs(w), hn::Abs(x)), hn::Max(hn::Abs(y), hn::Abs(z))), hn::Set(d, 1e-30f));
  const V one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f);
  const V inverse = hn::Div(one, largest);
  w = hn::Mul(w, inverse), x = hn::Mul(x, inverse), y = hn::Mul(y, inverse), z = hn::Mul(z, inverse);
  const V length = hn::Sqrt(hn::MulAdd(w, w, hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z)))));
  const V scale = hn::Div(one, hn::Max(length, hn::Mul(hn::Set(d, 1e-12f), inverse)));
  w = hn::Mul(w, scale), x = hn::Mul(x, scale), y = hn::Mul(y, scale), z = hn::Mul(z, scale);
  const V x2 = hn::Mul(two, x), y2 = hn::Mul(two, y), z2 = hn::Mul(two, z);
  Axes r;
  r.xx = hn::NegMulAdd(z2, z, hn::NegMulAdd(y2, y, one));
  r.yy = hn::NegMulAdd(z2, z, hn::NegMulAdd(x2, x, one));
  r.zz = hn::NegMulAdd(y2, y, hn::NegMulAdd(x2, x, one));
  r.xy = hn::MulSub(x2, y, hn::Mul(z2, w));
  r.yx = hn::MulAdd(x2, y, hn::Mul(z2, w));
  r.xz = hn::MulAdd(x2, z, hn::Mul(y2, w));
  r.zx = hn::MulSub(x2, z, hn::Mul(y2, w));
  r.yz = hn::MulSub(y2, z, hn::Mul(x2, w));
  r.zy = hn::MulAdd(y2, z, hn::Mul(x2, w));
  return r;
}

/// Projects lanes [i, i + n) of the cloud and appends those that reach `pixels`.
void ProjectVector(D d, const scene::GaussianCloud& cloud, const ViewParams<float>& view, Culling culling,
                   scene::Rect pixels, std::size_t i, std::size_t n, Survivors& out) {
  auto set = [&](double value) { return hn::Set(d, float(value)); };
  const auto& r = view.rotation;
  const V dx = hn::Sub(hn::Sub(Load(d, cloud.mean.x.data() + i, n), set(view.centre_high[0])), set(view.centre_low[0]));
  const V dy = hn::Sub(hn::Sub(Load(d, cloud.mean.y.data() + i, n), set(view.centre_high[1])), set(view.centre_low[1]));
  const V dz = hn::Sub(hn::Sub(Load(d, cloud.mean.z.data() + i, n), set(view.centre_high[2])), set(view.centre_low[2]));
  auto rotated = [&](std::size_t row, V a, V b, V c) {
    return hn::MulAdd(set(r[3 * row]), a, hn::MulAdd(set(r[3 * row + 1]), b, hn::Mul(set(r[3 * row + 2]), c)));
  };
  const V px = rotated(0, dx, dy, dz), py = rotated(1, dx, dy, dz), pz = rotated(2, dx, dy, dz);
  const V far_away = set(1e18);
  auto alive = hn::And(hn::And(hn::Gt(pz, set(near_plane)), hn::Lt(pz, far_away)), hn::FirstN(d, n));
  if (hn::AllFalse(d, alive)) return;

  const V inverse_z = hn::Div(set(1), pz);
  const V x_over_z = hn::Mul(px, inverse_z), y_over_z = hn::Mul(py, inverse_z);
  const V x = hn::MulAdd(set(view.fx), x_over_z, set(view.cx));
  const V y = hn::MulAdd(set(view.fy), y_over_z, set(view.cy));
  alive = hn::And(alive, hn::And(hn::Lt(hn::Abs(x), far_away), hn::Lt(hn::Abs(y), far_away)));

  const V jx = hn::Mul(set(view.fx), inverse_z), jy = hn::Mul(set(view.fy), inverse_z);
  const V tx = hn::Clamp(x_over_z, set(view.min_x_over_z), set(view.max_x_over_z));
  const V ty = hn::Clamp(y_over_z, set(view.min_y_over_z), set(view.max_y_over_z));
  if (culling == Culling::by_bound) {
    // A splat ends at most sqrt(2 ln 255) = 3.33 standard deviations from its mean, and those are at most
    // j sigma sqrt(1 + t^2) and the low pass, added as squares: less than the sum of all.
    const V largest =
        hn::Max(Load(d, cloud.log_scale.x.data() + i, n),
                hn::Max(Load(d, cloud.log_scale.y.data() + i, n), Load(d, cloud.log_scale.z.data() + i, n)));
    const V reach = hn::Mul(hn::Exp(d, hn::Clamp(largest, set(-max_log_scale), set(max_log_scale))), set(3.35));
    const V bound_x = hn::MulAdd(hn::Mul(jx, reach), hn::Add(hn::Abs(tx), set(1)), set(3));
    const V bound_y = hn::MulAdd(hn::Mul(jy, reach), hn::Add(hn::Abs(ty), set(1)), set(3));
    const auto meets = [&](V middle, V bound, int first, int end) {
      return hn::And(hn::Ge(hn::Add(middle, bound), set(first)), hn::Le(hn::Sub(middle, bound), set(end)));
    };
    alive = hn::And(alive, hn::And(meets(x, bound_x, pixels.x0, pixels.x1), meets(y, bound_y, pixels.y0, pixels.y1)));
    if (hn::AllFalse(d, alive)) return;
  }

  // log2 of the sigmoid, by log1p so that nearly opaque Gaussians keep their digits.
  const V logit =
      hn::Clamp(Load(d, cloud.opacity_logit.data() + i, n), set(-max_opacity_logit), set(max_opacity_logit));
  const V log2_opacity = hn::Mul(hn::Log1p(d, hn::Exp(d, hn::Neg(logit))), set(-1.4426950408889634));
  const V q_max = hn::Add(log2_opacity, set(log2_255));  // beyond this q, alpha is below 1/255
  alive = hn::And(alive, hn::Ge(q_max, hn::Zero(d)));
  if (hn::AllFalse(d, alive)) return;

  const Axes q = RotationMatrix(d, Load(d, cloud.rotation.w.data() + i, n), Load(d, cloud.rotation.x.data() + i, n),
                                Load(d, cloud.rotation.y.data() + i, n), Load(d, cloud.rotation.z.data() + i, n));
  auto sigma = [&](const std::vector<float>& log_scale) {
    return hn::Exp(d, hn::Clamp(Load(d, log_scale.data() + i, n), set(-max_log_scale), set(max_log_scale)));
  };
  V unit = set(1);
  V u[3], v[3];
  auto project_axis = [&](int j, V ax, V ay, V az, V s) {
    const V along_z = rotated(2, ax, ay, az);
    u[j] = hn::Mul(hn::Mul(jx, s), hn::NegMulAdd(tx, along_z, rotated(0, ax, ay, az)));
    v[j] = hn::Mul(hn::Mul(jy, s), hn::NegMulAdd(ty, along_z, rotated(1, ax, ay, az)));
    unit = hn::Max(unit, hn::Max(hn::Abs(u[j]), hn::Abs(v[j])));
  };
  project_axis(0, q.xx, q.yx, q.zx, sigma(cloud.log_scale.x));
  project_axis(1, q.xy, q.yy, q.zy, sigma(cloud.log_scale.y));
  project_axis(2, q.xz, q.yz, q.zz, sigma(cloud.log_scale.z));
  const V inverse_unit = hn::Div(set(1), unit);
  for (int j = 0; j < 3; ++j) u[j] = hn::Mul(u[j], inverse_unit), v[j] = hn::Mul(v[j], inverse_unit);
  const V low_pass = hn::Mul(set(low_pass_px2), hn::Mul(inverse_unit, inverse_unit));
  auto dot = [](const V* a, const V* b) { return hn::MulAdd(a[0], b[0], hn::MulAdd(a[1], b[1], hn::Mul(a[2], b[2]))); };
  const V uu = dot(u, u), uv = dot(u, v), vv = dot(v, v);
  const V cross[3] = {hn::MulSub(u[1], v[2], hn::Mul(u[2], v[1])), hn::MulSub(u[2], v[0], hn::Mul(u[0], v[2])),
                      hn::MulSub(u[0], v[1], hn::Mul(u[1], v[0]))};
  const V determinant = hn::Add(dot(cross, cross), hn::MulAdd(low_pass, hn::Add(uu, vv), hn::Mul(low_pass, low_pass)));
  const V yy = hn::Add(vv, low_pass);
  const V scale = set(0.84932180028801904);  // sqrt(log2(e) / 2): see Splat
  const V l1 = hn::Mul(hn::Mul(hn::Sqrt(hn::Div(yy, determinant)), inverse_unit), scale);
  const V l2 = hn::Neg(hn::Div(hn::Mul(l1, uv), yy));
  const V l3 = hn::Mul(hn::Div(inverse_unit, hn::Sqrt(yy)), scale);

  // Half extents at alpha = 1/255: sqrt(q_max) standard deviations, in q's units. A hundredth of a pixel covers
  // rounding.
  const V reach = hn::Mul(hn::Div(hn::Sqrt(q_max), scale), unit);
  const V half_x = hn::MulAdd(reach, hn::Sqrt(hn::Add(uu, low_pass)), set(0.01));
  const V half_y = hn::MulAdd(reach, hn::Sqrt(yy), set(0.01));
  // Pixel centres within reach and within `pixels`; a splat that lies between the centres has none.
  const hn::RebindToSigned<D> di;
  const V first_x = hn::Ceil(hn::Max(hn::Sub(x, half_x), set(pixels.x0)));
  const V last_x = hn::Floor(hn::Min(hn::Add(x, half_x), set(pixels.x1 - 1)));
  const V first_y = hn::Ceil(hn::Max(hn::Sub(y, half_y), set(pixels.y0)));
  const V last_y = hn::Floor(hn::Min(hn::Add(y, half_y), set(pixels.y1 - 1)));
  alive = hn::And(alive, hn::And(hn::Le(first_x, last_x), hn::Le(first_y, last_y)));
  if (hn::AllFalse(d, alive)) return;
  auto tile_range = [&](V first, V last) {
    return hn::Or(hn::ShiftRight<log2_tile_size>(hn::ConvertTo(di, first)),
                  hn::ShiftLeft<16>(hn::ShiftRight<log2_tile_size>(hn::ConvertTo(di, last))));
  };

  const V inverse_length = hn::Div(set(1), hn::Sqrt(hn::MulAdd(dx, dx, hn::MulAdd(dy, dy, hn::Mul(dz, dz)))));
  const std::size_t at = out.count;
  // Compacts by one permutation for all fields. (Highway's Compress() looks its permutation up in a table that GCC 12
  // copies to the stack each time.) Whole vectors are stored; the next ones overwrite what is too much.
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, alive, bits);
  alignas(64) std::int32_t lane[hn::MaxLanes(D())] = {};
  std::size_t count = 0;
  for (std::size_t k = 0; k < hn::Lanes(d); ++k) {
    lane[count] = std::int32_t(k);
    count += bits[k / 8] >> (k % 8) & 1;
  }
  const auto order = hn::SetTableIndices(d, lane);
  auto append = [&](V value, float* to) { hn::StoreU(hn::TableLookupLanes(value, order), d, to + at); };
  append(x, out.x);
  append(y, out.y);
  append(pz, out.depth);
  append(l1, out.l1);
  append(l2, out.l2);
  append(l3, out.l3);
  append(log2_opacity, out.log2_opacity);
  append(hn::Mul(dx, inverse_length), out.to_x);
  append(hn::Mul(dy, inverse_length), out.to_y);
  append(hn::Mul(dz, inverse_length), out.to_z);
  auto append_i = [&](hn::Vec<hn::RebindToSigned<D>> value, std::int32_t* to) {
    hn::StoreU(hn::BitCast(di, hn::TableLookupLanes(hn::BitCast(d, value), order)), di, to + at);
  };
  append_i(tile_range(first_x, last_x), out.columns);
  append_i(tile_range(first_y, last_y), out.rows);
  append_i(hn::Iota(di, std::int32_t(i)), out.row);
  out.count += count;
}

/// Rows whose coefficients are asked for before they are needed: it is a frame's first sight of them.
constexpr std::size_t fetch_ahead = 16;

/// Writes the survivors that are not hidden, with their colours.
///   kDegree  bands used, -1 for none: black
template <int kDegree>
std::size_t WriteSplats(const ProjectedLayer& layer, std::size_t begin, const Survivors& found, Splat* out) {
  const scene::GaussianCloud& cloud = layer.cloud;
  const std::size_t stored = scene::sh_coefficients(cloud.sh_degree), stride = cloud.sh_stride();
  const auto sh = [&](std::size_t k) { return cloud.sh.data() + std::size_t(found.row[k]) * stride; };
  const std::uint32_t* hidden = std::lower_bound(layer.hidden.data(), layer.hidden.data() + layer.hidden.size(), begin);
  const std::uint32_t* const last_hidden = layer.hidden.data() + layer.hidden.size();
  constexpr std::size_t at_once = 128;  // whose bases stay in the first cache
  alignas(64) Basis basis[at_once];
  std::size_t written = 0;
  for (std::size_t k = 0; k < found.count; ++k) {
    if constexpr (kDegree >= 0) {
      if (k % at_once == 0)
        EachBasis<kDegree>(found.to_x + k, found.to_y + k, found.to_z + k, HWY_MIN(at_once, found.count - k), basis);
      FetchRow(sh(HWY_MIN(k + fetch_ahead, found.count - 1)), stride);
    }
    const auto row = std::size_t(found.row[k]);
    while (hidden != last_hidden && *hidden < row) ++hidden;
    if (hidden != last_hidden && *hidden == row) continue;
    float color[3] = {};
    if constexpr (kDegree >= 0) {
      ShadeRow<kDegree>(sh(k), stored, basis[k % at_once], color);
      for (float& c : color) c = c > 0.0f ? (c < float(max_color) ? c : float(max_color)) : 0.0f;  // NaN becomes 0
    }
    out[written++] = {.x = found.x[k],
                      .y = found.y[k],
                      .l1 = found.l1[k],
                      .l2 = found.l2[k],
                      .l3 = found.l3[k],
                      .log2_opacity = found.log2_opacity[k],
                      .weight = layer.weight != nullptr ? layer.weight[row] : 0.0f,
                      .row = std::uint32_t(layer.first_row + row),
                      .red = color[0],
                      .green = color[1],
                      .blue = color[2],
                      .depth = found.depth[k],
                      .box = {std::uint16_t(found.columns[k] & 0xffff), std::uint16_t(found.columns[k] >> 16),
                              std::uint16_t(found.rows[k] & 0xffff), std::uint16_t(found.rows[k] >> 16)},
                      .pairs = {}};
  }
  return written;
}

std::size_t ProjectRows(const ProjectedLayer& layer, const ViewParams<float>& view, int sh_degree, Culling culling,
                        scene::Rect pixels, std::size_t begin, std::size_t end, Splat* out) {
  const D d;
  Survivors found;
  for (std::size_t i = begin; i < end; i += hn::Lanes(d))
    ProjectVector(d, layer.cloud, view, culling, pixels, i, HWY_MIN(hn::Lanes(d), end - i), found);
  if (sh_degree < 0) return WriteSplats<-1>(layer, begin, found, out);
  return WithDegree(sh_degree, [&](auto degree) { return WriteSplats<degree>(layer, begin, found, out); });
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(ProjectRows);

std::size_t project_rows(const ProjectedLayer& layer, const ViewParams<float>& view, int sh_degree, Culling culling,
                         scene::Rect pixels, std::size_t begin, std::size_t end, Splat* out) {
  return HWY_DYNAMIC_DISPATCH(ProjectRows)(layer, view, sh_degree, culling, pixels, begin, end, out);
}

}  // namespace engine::render
#endif
