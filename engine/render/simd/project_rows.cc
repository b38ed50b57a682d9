// Projection of rows of Gaussians, a vector of them at a time: the formulas of engine/render/projection.inc, what can
// be dropped between one and the next, and the splats that are left.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/project_rows.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/simd/lanes.inc"
#include "engine/render/simd/shade_rows.inc"

#include <algorithm>

#include "engine/render/splats.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

#include "engine/render/projection.inc"

/// Survivors of a block, one array per field, before their colours are known.
struct Survivors {
  static constexpr std::size_t room = project_block + 64;  // whole vectors are stored
  alignas(64) float x[room], y[room], depth[room], l1[room], l2[room], l3[room], log2_opacity[room];
  alignas(64) float to_x[room], to_y[room], to_z[room];           // unit direction from the camera centre
  alignas(64) std::int32_t row[room], columns[room], rows[room];  // tiles: first | last << 16
  std::size_t count = 0;
};

/// Some Gaussians that lie side by side in a cloud, no more than there are lanes.
struct Rows {
  const scene::GaussianCloud& cloud;
  std::size_t begin, count;

  /// Their values of a column; zero in the lanes beyond.
  HWY_INLINE Lanes Load(const std::vector<float>& column) const {
    const LanesD d;
    const float* const from = column.data() + begin;
    if (count >= hn::Lanes(d)) return Lanes(hn::LoadU(d, from));
    alignas(64) float padded[hn::MaxLanes(LanesD())] = {};  // not MaskedLoad(): with SSE it reads the whole vector
    std::copy_n(from, count, padded);
    return Lanes(hn::Load(d, padded));
  }
};

/// Whether splats at (x, y) may reach the rectangle, by a bound on their extent. They end at most sqrt(2 ln 255) = 3.33
/// standard deviations from the mean, and those are at most j sigma sqrt(1 + t^2), sigma being that of the longest
/// axis, and the low pass, added as squares: less than the sum of all.
HWY_INLINE Mask MayReach(const Rows& rows, const Perspective<Lanes>& at, Lanes x, Lanes y, scene::Rect pixels) {
  const scene::GaussianCloud& cloud = rows.cloud;
  const Lanes longest =
      max(rows.Load(cloud.log_scale.x), max(rows.Load(cloud.log_scale.y), rows.Load(cloud.log_scale.z)));
  const Lanes reach = scale(longest) * Lanes(3.35);
  const Lanes bound_x = mul_add(at.jx * reach, abs(at.tx) + Lanes(1), Lanes(3));
  const Lanes bound_y = mul_add(at.jy * reach, abs(at.ty) + Lanes(1), Lanes(3));
  const auto meets = [](Lanes middle, Lanes bound, int first, int end) {
    return hn::And(middle + bound >= Lanes(first), middle - bound <= Lanes(end));
  };
  return hn::And(meets(x, bound_x, pixels.x0, pixels.x1), meets(y, bound_y, pixels.y0, pixels.y1));
}

/// log2 of the opacity, 1 / (1 + exp(-logit)), by log1p so that nearly opaque Gaussians keep their digits:
///   -log2(e) log1p(exp(-logit)).
HWY_INLINE Lanes Log2Opacity(Lanes logit) {
  const Lanes saturated = clamp(logit, Lanes(-max_opacity_logit), Lanes(max_opacity_logit));
  return log1p(exp(-saturated)) * Lanes(-1.4426950408889634);
}

/// The covariances of the rows' splats.
HWY_INLINE Covariance<Lanes> CovarianceOf(const Rows& rows, const ViewParams<float>& view,
                                          const Perspective<Lanes>& at) {
  const scene::GaussianCloud& cloud = rows.cloud;
  const std::array<Lanes, 9> r =
      rotation_matrix(unit_quaternion<Lanes>({rows.Load(cloud.rotation.w), rows.Load(cloud.rotation.x),
                                              rows.Load(cloud.rotation.y), rows.Load(cloud.rotation.z)}));
  Vector<Lanes> u, v;  // rows of J W R S, pixels
  const auto project_axis = [&](std::size_t j, const std::vector<float>& log_scale) {
    const Lanes sigma = scale(rows.Load(log_scale));
    const auto [u_j, v_j] = on_picture(at, at.jx * sigma, at.jy * sigma, axis_in_camera(view, r, j));
    u[j] = u_j, v[j] = v_j;
  };
  project_axis(0, cloud.log_scale.x), project_axis(1, cloud.log_scale.y), project_axis(2, cloud.log_scale.z);
  return covariance(u, v);
}

/// Length of K d at one standard deviation in Splat, where exp2(-|K d|^2) is the falloff: sqrt(log2(e) / 2).
constexpr double splat_sigma = 0.84932180028801904;

/// First and last pixel centres, in columns and in rows: whole numbers.
struct PixelBox {
  Lanes first_x, last_x, first_y, last_y;

  [[nodiscard]] HWY_INLINE Mask Any() const { return hn::And(first_x <= last_x, first_y <= last_y); }
};

/// The pixel centres of the rectangle where splats at (x, y) may have an alpha of 1/255. There |K d|^2 <= q_max, so the
/// half extents are sqrt(q_max) / splat_sigma standard deviations of the marginals. A hundredth of a pixel covers
/// rounding. A splat that lies between the centres has none.
HWY_INLINE PixelBox BoxOf(const Covariance<Lanes>& cov, Lanes x, Lanes y, Lanes q_max, scene::Rect pixels) {
  const Lanes reach = sqrt(q_max) / Lanes(splat_sigma) * cov.unit;
  const Lanes half_x = mul_add(reach, sqrt(cov.uu + cov.low_pass), Lanes(0.01));
  const Lanes half_y = mul_add(reach, sqrt(cov.yy), Lanes(0.01));
  return {ceil(max(x - half_x, Lanes(pixels.x0))), floor(min(x + half_x, Lanes(pixels.x1 - 1))),
          ceil(max(y - half_y, Lanes(pixels.y0))), floor(min(y + half_y, Lanes(pixels.y1 - 1)))};
}

/// Moves the lanes that are alive to the front, in order, by one permutation for all vectors. (Highway's Compress()
/// looks its permutation up in a table that GCC 12 copies to the stack each time.)
class Compaction {
 public:
  HWY_INLINE explicit Compaction(Mask alive) {
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(LanesD(), alive, bits);
    for (std::size_t k = 0; k < hn::Lanes(LanesD()); ++k) {
      lane_[count_] = std::int32_t(k);
      count_ += bits[k / 8] >> (k % 8) & 1;
    }
  }
  /// How many are alive.
  [[nodiscard]] HWY_INLINE std::size_t Count() const { return count_; }
  [[nodiscard]] HWY_INLINE auto Order() const { return hn::SetTableIndices(LanesD(), lane_); }

 private:
  alignas(64) std::int32_t lane_[hn::MaxLanes(LanesD())] = {};
  std::size_t count_ = 0;
};

/// What is stored of splats that are alive.
struct Projected {
  Lanes x, y, depth;
  FalloffMatrix<Lanes> K;
  Lanes log2_opacity;
  PixelBox box;
};

/// Appends those that are alive. Whole vectors are stored; the next ones overwrite what is too much.
///   d  from_centre()
HWY_INLINE void Append(const Rows& rows, Mask alive, const Projected& splats, const Vector<Lanes>& d, Survivors& out) {
  const LanesD any;
  const hn::RebindToSigned<LanesD> di;
  const auto tile_range = [&](Lanes first, Lanes last) {
    return hn::Or(hn::ShiftRight<log2_tile_size>(hn::ConvertTo(di, first.v)),
                  hn::ShiftLeft<16>(hn::ShiftRight<log2_tile_size>(hn::ConvertTo(di, last.v))));
  };
  const Vector<Lanes> to = direction(d).to;
  const Compaction compaction(alive);
  const auto order = compaction.Order();
  const std::size_t at = out.count;
  const auto append = [&](Lanes value, float* column) {
    hn::StoreU(hn::TableLookupLanes(value.v, order), any, column + at);
  };
  append(splats.x, out.x), append(splats.y, out.y), append(splats.depth, out.depth);
  append(splats.K.l1, out.l1), append(splats.K.l2, out.l2), append(splats.K.l3, out.l3);
  append(splats.log2_opacity, out.log2_opacity);
  append(to[0], out.to_x), append(to[1], out.to_y), append(to[2], out.to_z);
  const auto append_int = [&](hn::Vec<hn::RebindToSigned<LanesD>> value, std::int32_t* column) {
    hn::StoreU(hn::BitCast(di, hn::TableLookupLanes(hn::BitCast(any, value), order)), di, column + at);
  };
  append_int(tile_range(splats.box.first_x, splats.box.last_x), out.columns);
  append_int(tile_range(splats.box.first_y, splats.box.last_y), out.rows);
  append_int(hn::Iota(di, std::int32_t(rows.begin)), out.row);
  out.count += compaction.Count();
}

/// Projects the rows and appends those that reach `pixels`. As soon as none is left, it goes no further.
HWY_INLINE void ProjectVector(const Rows& rows, const ViewParams<float>& view, Culling culling, scene::Rect pixels,
                              Survivors& out) {
  const LanesD any;
  const scene::GaussianCloud& cloud = rows.cloud;
  const Vector<Lanes> d =
      from_centre<Lanes>(view, {rows.Load(cloud.mean.x), rows.Load(cloud.mean.y), rows.Load(cloud.mean.z)});
  const Vector<Lanes> p = to_camera(view, d);
  const Lanes far = Lanes(far_away);
  Mask alive = hn::And(hn::And(p[2] > Lanes(near_plane), p[2] < far), hn::FirstN(any, rows.count));
  if (hn::AllFalse(any, alive)) return;

  const Perspective<Lanes> at = perspective(view, p);
  Projected splats;
  splats.x = pixel_x(view, at), splats.y = pixel_y(view, at), splats.depth = p[2];
  alive = hn::And(alive, hn::And(abs(splats.x) < far, abs(splats.y) < far));
  if (culling == Culling::by_bound) {
    alive = hn::And(alive, MayReach(rows, at, splats.x, splats.y, pixels));
    if (hn::AllFalse(any, alive)) return;
  }

  splats.log2_opacity = Log2Opacity(rows.Load(cloud.opacity_logit));
  const Lanes q_max = splats.log2_opacity + Lanes(log2_255);  // |K d|^2 beyond which alpha is below 1/255
  alive = hn::And(alive, q_max >= Lanes(0));
  if (hn::AllFalse(any, alive)) return;

  const Covariance<Lanes> cov = CovarianceOf(rows, view, at);
  splats.K = falloff_matrix(cov, Lanes(splat_sigma));
  splats.box = BoxOf(cov, splats.x, splats.y, q_max, pixels);
  alive = hn::And(alive, splats.box.Any());
  if (hn::AllFalse(any, alive)) return;
  Append(rows, alive, splats, d, out);
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
  const std::size_t lanes = hn::Lanes(LanesD());
  Survivors found;
  for (std::size_t i = begin; i < end; i += lanes)
    ProjectVector({layer.cloud, i, HWY_MIN(lanes, end - i)}, view, culling, pixels, found);
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
