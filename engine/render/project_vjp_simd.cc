// The pullbacks of project_vjp.h, a vector of Gaussians at a time.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/project_vjp_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: the math functions are compiled once per instruction set.
#include <hwy/contrib/math/math-inl.h>

#include "engine/render/backward_stages.h"
#include "engine/render/project_vjp.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using VjpD = hn::ScalableTag<float>;
using VjpV = hn::Vec<VjpD>;

/// Rows of a block that some tile has, one array per value, and what becomes of them.
struct SeenRows {
  static constexpr std::size_t room = project_vjp_block + 64;  // whole vectors are loaded and stored
  alignas(64) float mean[3][room], log_scale[3][room], rotation[4][room], logit[room];
  alignas(64) float sums[TileGradient::sums][room];
  // out
  alignas(64) float v_mean[3][room], v_log_scale[3][room], v_rotation[4][room], v_logit[room], v_x[room], v_y[room];
  alignas(64) float to[3][room], inverse_distance[room];  // unit direction from the camera centre
  std::uint32_t slot[room];                               // in the list of rows that may change
  std::size_t count = 0;
};

/// Three components.
struct V3 {
  VjpV x, y, z;
};

HWY_INLINE VjpV Dot(const V3& a, const V3& b) { return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z))); }
HWY_INLINE V3 Cross(const V3& a, const V3& b) {
  return {hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
          hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
}
HWY_INLINE V3 Scaled(const V3& a, VjpV s) { return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)}; }
HWY_INLINE V3 Sum(const V3& a, const V3& b) { return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)}; }

/// project_vjp() and opacity_logit_gradient() for the seen rows [i, i + lanes). All of them are visible.
HWY_INLINE void ProjectVjpVector(VjpD d, const ViewParams<float>& view, std::size_t i, SeenRows& rows) {
  const auto set = [&](double value) { return hn::Set(d, float(value)); };
  const auto load = [&](const float* from) { return hn::Load(d, from + i); };
  const VjpV zero = hn::Zero(d), one = set(1), two = set(2);
  const auto& r = view.rotation;
  const auto rotated = [&](const V3& a) {  // cam_from_world
    return V3{hn::MulAdd(set(r[0]), a.x, hn::MulAdd(set(r[1]), a.y, hn::Mul(set(r[2]), a.z))),
              hn::MulAdd(set(r[3]), a.x, hn::MulAdd(set(r[4]), a.y, hn::Mul(set(r[5]), a.z))),
              hn::MulAdd(set(r[6]), a.x, hn::MulAdd(set(r[7]), a.y, hn::Mul(set(r[8]), a.z)))};
  };
  const auto rotated_back = [&](const V3& a) {  // world_from_cam
    return V3{hn::MulAdd(set(r[0]), a.x, hn::MulAdd(set(r[3]), a.y, hn::Mul(set(r[6]), a.z))),
              hn::MulAdd(set(r[1]), a.x, hn::MulAdd(set(r[4]), a.y, hn::Mul(set(r[7]), a.z))),
              hn::MulAdd(set(r[2]), a.x, hn::MulAdd(set(r[5]), a.y, hn::Mul(set(r[8]), a.z)))};
  };

  // As in project().
  const auto from_centre = [&](std::size_t axis) {
    return hn::Sub(hn::Sub(load(rows.mean[axis]), set(view.centre_high[axis])), set(view.centre_low[axis]));
  };
  const V3 from_camera{from_centre(0), from_centre(1), from_centre(2)};
  const V3 p = rotated(from_camera);
  const VjpV inverse_z = hn::Div(one, p.z);
  const VjpV x_over_z = hn::Mul(p.x, inverse_z), y_over_z = hn::Mul(p.y, inverse_z);
  const VjpV jx = hn::Mul(set(view.fx), inverse_z), jy = hn::Mul(set(view.fy), inverse_z);
  const VjpV tx = hn::Clamp(x_over_z, set(view.min_x_over_z), set(view.max_x_over_z));
  const VjpV ty = hn::Clamp(y_over_z, set(view.min_y_over_z), set(view.max_y_over_z));

  VjpV w = load(rows.rotation[0]), x = load(rows.rotation[1]), y = load(rows.rotation[2]), z = load(rows.rotation[3]);
  const VjpV largest = hn::Max(hn::Max(hn::Max(hn::Abs(w), hn::Abs(x)), hn::Max(hn::Abs(y), hn::Abs(z))), set(1e-30));
  const VjpV inverse_largest = hn::Div(one, largest);
  w = hn::Mul(w, inverse_largest), x = hn::Mul(x, inverse_largest);
  y = hn::Mul(y, inverse_largest), z = hn::Mul(z, inverse_largest);
  const VjpV length = hn::Sqrt(hn::MulAdd(w, w, hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z)))));
  const VjpV guard = hn::Mul(set(1e-12), inverse_largest);
  const auto has_direction = hn::Gt(length, guard);
  const VjpV inverse_length = hn::Div(one, hn::Max(length, guard));
  w = hn::Mul(w, inverse_length), x = hn::Mul(x, inverse_length);
  y = hn::Mul(y, inverse_length), z = hn::Mul(z, inverse_length);
  const VjpV x2 = hn::Mul(two, x), y2 = hn::Mul(two, y), z2 = hn::Mul(two, z);
  const V3 columns[3] = {{hn::NegMulAdd(z2, z, hn::NegMulAdd(y2, y, one)), hn::MulAdd(x2, y, hn::Mul(z2, w)),
                          hn::MulSub(x2, z, hn::Mul(y2, w))},
                         {hn::MulSub(x2, y, hn::Mul(z2, w)), hn::NegMulAdd(z2, z, hn::NegMulAdd(x2, x, one)),
                          hn::MulAdd(y2, z, hn::Mul(x2, w))},
                         {hn::MulAdd(x2, z, hn::Mul(y2, w)), hn::MulSub(y2, z, hn::Mul(x2, w)),
                          hn::NegMulAdd(y2, y, hn::NegMulAdd(x2, x, one))}};

  VjpV sigma[3], unit = one;
  V3 axes[3];  // one sigma long, camera space
  VjpV u[3], v[3];
  for (std::size_t j = 0; j < 3; ++j) {
    sigma[j] = hn::Exp(d, hn::Clamp(load(rows.log_scale[j]), set(-max_log_scale), set(max_log_scale)));
    axes[j] = Scaled(rotated(columns[j]), sigma[j]);
    u[j] = hn::Mul(jx, hn::NegMulAdd(tx, axes[j].z, axes[j].x));
    v[j] = hn::Mul(jy, hn::NegMulAdd(ty, axes[j].z, axes[j].y));
    unit = hn::Max(unit, hn::Max(hn::Abs(u[j]), hn::Abs(v[j])));
  }
  const VjpV inverse_unit = hn::Div(one, unit);
  const V3 us = Scaled({u[0], u[1], u[2]}, inverse_unit), vs = Scaled({v[0], v[1], v[2]}, inverse_unit);
  const VjpV low_pass = hn::Mul(set(low_pass_px2), hn::Mul(inverse_unit, inverse_unit));
  const V3 normal = Cross(us, vs);
  const VjpV determinant = hn::Add(
      Dot(normal, normal), hn::MulAdd(low_pass, hn::Add(Dot(us, us), Dot(vs, vs)), hn::Mul(low_pass, low_pass)));
  const VjpV yy = hn::Add(Dot(vs, vs), low_pass), inverse_yy = hn::Div(one, yy);
  const VjpV l1 = hn::Sqrt(hn::Div(yy, determinant)), l3 = hn::Sqrt(inverse_yy);
  const VjpV l2 = hn::Neg(hn::Mul(hn::Mul(l1, Dot(us, vs)), inverse_yy));  // all times 1 / unit

  // From the units of Splat to those of SplatGradient.
  const VjpV to_sigmas = set(1.1774100225154747), to_sigmas_squared = set(1.3862943611198906);  // sqrt(2 ln 2), 2 ln 2
  const VjpV along = hn::Mul(load(rows.sums[1]), to_sigmas), across = hn::Mul(load(rows.sums[2]), to_sigmas);
  const VjpV strain_11 = hn::Mul(load(rows.sums[3]), to_sigmas_squared),
             strain_12 = hn::Mul(load(rows.sums[4]), to_sigmas_squared),
             strain_22 = hn::Mul(load(rows.sums[5]), to_sigmas_squared);
  const VjpV v_x = hn::Mul(hn::Mul(l1, inverse_unit), along);
  const VjpV v_y = hn::Mul(hn::MulAdd(l2, along, hn::Mul(l3, across)), inverse_unit);

  const V3 rest = Cross(vs, normal);
  const VjpV l1_over_yy = hn::Mul(l1, inverse_yy), l1_px = hn::Mul(l1, inverse_unit), l2_px = hn::Mul(l2, inverse_unit),
             l3_px = hn::Mul(l3, inverse_unit);
  const auto row_u = [&](VjpV rest_j, VjpV u_j, VjpV v_j, VjpV& v_u, VjpV& v_v) {
    const VjpV e1 = hn::Mul(l1_over_yy, hn::MulAdd(low_pass, u_j, rest_j)), e2 = hn::Mul(l3, v_j);
    const VjpV v_e1 = hn::MulAdd(strain_11, e1, hn::Mul(strain_12, e2));
    const VjpV v_e2 = hn::MulAdd(strain_12, e1, hn::Mul(strain_22, e2));
    v_u = hn::Mul(l1_px, v_e1);
    v_v = hn::MulAdd(l2_px, v_e1, hn::Mul(l3_px, v_e2));
  };
  VjpV v_u[3], v_v[3];
  row_u(rest.x, us.x, vs.x, v_u[0], v_v[0]);
  row_u(rest.y, us.y, vs.y, v_u[1], v_v[1]);
  row_u(rest.z, us.z, vs.z, v_u[2], v_v[2]);

  VjpV v_tx = zero, v_ty = zero, v_size = zero;
  V3 v_columns[3];
  for (std::size_t j = 0; j < 3; ++j) {
    const VjpV v_axis_x = hn::Mul(jx, v_u[j]), v_axis_y = hn::Mul(jy, v_v[j]);
    v_tx = hn::NegMulAdd(v_axis_x, axes[j].z, v_tx);
    v_ty = hn::NegMulAdd(v_axis_y, axes[j].z, v_ty);
    v_size = hn::MulAdd(v_u[j], u[j], hn::MulAdd(v_v[j], v[j], v_size));
    const V3 v_axis{v_axis_x, v_axis_y, hn::Neg(hn::MulAdd(tx, v_axis_x, hn::Mul(ty, v_axis_y)))};
    const auto inside = hn::Le(hn::Abs(load(rows.log_scale[j])), set(max_log_scale));
    hn::Store(hn::IfThenElseZero(inside, Dot(v_axis, axes[j])), d, rows.v_log_scale[j] + i);
    v_columns[j] = Scaled(rotated_back(v_axis), sigma[j]);
  }

  // rotation_matrix_vjp(); v_r[row][column] is component `row` of v_columns[column].
  const V3 &a = v_columns[0], &b = v_columns[1], &c = v_columns[2];
  const VjpV sxy = hn::Add(b.x, a.y), sxz = hn::Add(c.x, a.z), syz = hn::Add(c.y, b.z);
  const VjpV dx = hn::Sub(b.z, c.y), dy = hn::Sub(c.x, a.z), dz = hn::Sub(a.y, b.x);
  const VjpV q[4] = {w, x, y, z};
  VjpV v_q[4] = {hn::MulAdd(x, dx, hn::MulAdd(y, dy, hn::Mul(z, dz))),
                 hn::NegMulAdd(x2, hn::Add(b.y, c.z), hn::MulAdd(y, sxy, hn::MulAdd(z, sxz, hn::Mul(w, dx)))),
                 hn::NegMulAdd(y2, hn::Add(a.x, c.z), hn::MulAdd(x, sxy, hn::MulAdd(z, syz, hn::Mul(w, dy)))),
                 hn::NegMulAdd(z2, hn::Add(a.x, b.y), hn::MulAdd(x, sxz, hn::MulAdd(y, syz, hn::Mul(w, dz))))};
  const VjpV along_q = hn::MulAdd(v_q[0], w, hn::MulAdd(v_q[1], x, hn::MulAdd(v_q[2], y, hn::Mul(v_q[3], z))));
  const VjpV q_scale = hn::Mul(two, inverse_length);
  for (std::size_t k = 0; k < 4; ++k) {
    const VjpV tangent = hn::Mul(hn::Mul(hn::NegMulAdd(along_q, q[k], v_q[k]), q_scale), inverse_largest);
    hn::Store(hn::IfThenElseZero(has_direction, tangent), d, rows.v_rotation[k] + i);
  }

  const VjpV v_x_over_z = hn::MulAdd(set(view.fx), v_x, hn::IfThenElseZero(hn::Eq(tx, x_over_z), v_tx));
  const VjpV v_y_over_z = hn::MulAdd(set(view.fy), v_y, hn::IfThenElseZero(hn::Eq(ty, y_over_z), v_ty));
  const VjpV shrinking = hn::MulAdd(v_x_over_z, x_over_z, hn::MulAdd(v_y_over_z, y_over_z, v_size));
  const V3 v_mean = rotated_back({hn::Mul(v_x_over_z, inverse_z), hn::Mul(v_y_over_z, inverse_z),
                                  hn::NegMulAdd(shrinking, inverse_z, load(rows.sums[9]))});
  hn::Store(v_mean.x, d, rows.v_mean[0] + i);
  hn::Store(v_mean.y, d, rows.v_mean[1] + i);
  hn::Store(v_mean.z, d, rows.v_mean[2] + i);
  hn::Store(v_x, d, rows.v_x + i);
  hn::Store(v_y, d, rows.v_y + i);

  const VjpV logit = load(rows.logit), bound = set(max_opacity_logit);
  const VjpV clear = hn::Div(one, hn::Add(one, hn::Exp(d, hn::Clamp(logit, hn::Neg(bound), bound))));  // 1 - opacity
  hn::Store(hn::IfThenElseZero(hn::Le(hn::Abs(logit), bound), hn::Mul(load(rows.sums[0]), clear)), d, rows.v_logit + i);

  const VjpV inverse_distance = hn::Div(one, hn::Sqrt(Dot(from_camera, from_camera)));
  const V3 to = Scaled(from_camera, inverse_distance);
  hn::Store(to.x, d, rows.to[0] + i);
  hn::Store(to.y, d, rows.to[1] + i);
  hn::Store(to.z, d, rows.to[2] + i);
  hn::Store(inverse_distance, d, rows.inverse_distance + i);
}

/// Bases of the seen rows' directions, row by row, and what they become: dL/dbasis.
struct Bases {
  static constexpr std::size_t size = scene::sh_coefficients(scene::max_sh_degree);
  alignas(64) float basis[project_vjp_block][size], v_basis[project_vjp_block][size];
};

/// All rows at once: the compiler makes vectors of the loops, since the degree is a constant.
template <int kDegree>
HWY_INLINE void EachBasis(const SeenRows& rows, Bases& bases) {
  for (std::size_t i = 0; i < rows.count; ++i)
    scene::sh_basis(kDegree, rows.to[0][i], rows.to[1][i], rows.to[2][i], bases.basis[i]);
}

/// Adds to the rows' v_mean what their direction gets from v_basis.
template <int kDegree>
HWY_INLINE void EachBasisVjp(const Bases& bases, SeenRows& rows) {
  for (std::size_t i = 0; i < rows.count; ++i) {
    const float to[3] = {rows.to[0][i], rows.to[1][i], rows.to[2][i]};
    const auto v_to = scene::sh_basis_vjp(kDegree, to[0], to[1], to[2], bases.v_basis[i]);
    const float along = v_to[0] * to[0] + v_to[1] * to[1] + v_to[2] * to[2];
    for (std::size_t axis = 0; axis < 3; ++axis)
      rows.v_mean[axis][i] += (v_to[axis] - along * to[axis]) * rows.inverse_distance[i];
  }
}

/// color_vjp() for the seen row i, up to the basis: adds to v_sh and writes v_basis.
template <class AnyD>
HWY_INLINE void ColorVjpRow(AnyD d, const float* sh, std::size_t stored, std::size_t used, std::size_t i,
                            const SeenRows& rows, Bases& bases, float* v_sh) {
  const std::size_t lanes = hn::Lanes(d);
  const float* const basis = bases.basis[i];
  float* const v_basis = bases.v_basis[i];
  std::fill_n(v_basis, Bases::size, 0.0f);
  for (std::size_t c = 0; c < 3; ++c, sh += stored, v_sh += stored) {
    const float v_color = rows.sums[6 + c][i];
    if (v_color == 0) continue;
    float sum = 0.5f;
    std::size_t k = 0;
    if (used >= lanes) {
      auto sums = hn::Zero(d);
      for (; k + lanes <= used; k += lanes) sums = hn::MulAdd(hn::LoadU(d, sh + k), hn::Load(d, basis + k), sums);
      sum += hn::GetLane(hn::SumOfLanes(d, sums));
    }
    for (; k < used; ++k) sum += sh[k] * basis[k];
    if (!(sum >= 0 && sum <= float(max_color))) continue;  // also when it is NaN
    const auto v = hn::Set(d, v_color);
    for (k = 0; k + lanes <= used; k += lanes) {
      hn::StoreU(hn::MulAdd(v, hn::Load(d, basis + k), hn::LoadU(d, v_sh + k)), d, v_sh + k);
      hn::Store(hn::MulAdd(v, hn::LoadU(d, sh + k), hn::Load(d, v_basis + k)), d, v_basis + k);
    }
    for (; k < used; ++k) {
      v_sh[k] += v_color * basis[k];
      v_basis[k] += v_color * sh[k];
    }
  }
}

/// color_vjp() for the seen rows, whose directions are known: adds to their v_mean, and to out.sh.
template <int kDegree>
void ColorVjp(const scene::GaussianCloud& cloud, std::size_t first_row, const std::uint32_t* row_of_slot,
              SeenRows& rows, Gradients& out) {
  constexpr std::size_t used = scene::sh_coefficients(kDegree);
  constexpr std::size_t lanes = used == 16 ? 16 : used >= 4 ? 4 : 1;
  const hn::CappedTag<float, lanes> d;
  const std::size_t stored = scene::sh_coefficients(cloud.sh_degree), stride = cloud.sh_stride();
  Bases bases;
  EachBasis<kDegree>(rows, bases);
  const auto sh = [&](std::size_t i) { return cloud.sh.data() + (row_of_slot[rows.slot[i]] - first_row) * stride; };
  const auto v_sh = [&](std::size_t i) { return out.sh.data() + rows.slot[i] * stride; };
  for (std::size_t i = 0; i < rows.count; ++i) {
    const std::size_t coming = HWY_MIN(i + 8, rows.count - 1);
    for (std::size_t k = 0; k < stride; k += 16) hwy::Prefetch(sh(coming) + k), hwy::Prefetch(v_sh(coming) + k);
    ColorVjpRow(d, sh(i), stored, used, i, rows, bases, v_sh(i));
  }
  EachBasisVjp<kDegree>(bases, rows);
}

/// Sums a row's gradients over its tiles, in their order and in double, into the seen row i. False if all are zero.
HWY_INLINE bool SumOverTiles(const TileGradient* first, const TileGradient* last, std::size_t i, SeenRows& rows) {
  constexpr std::size_t size = sizeof(TileGradient) / sizeof(float);
  const hn::CappedTag<double, 4> d64;
  const hn::Rebind<float, decltype(d64)> d32;
  constexpr std::size_t lanes = hn::MaxLanes(d64), parts = size / lanes;
  hn::Vec<decltype(d64)> total[parts];
  for (auto& part : total) part = hn::Zero(d64);
  constexpr std::ptrdiff_t ahead = 16;  // rows' pairs follow each other
  for (; first != last; ++first) {
    hwy::Prefetch(first + ahead);
    const auto* const values = reinterpret_cast<const float*>(first);
    for (std::size_t p = 0; p < parts; ++p)
      total[p] = hn::Add(total[p], hn::PromoteTo(d64, hn::LoadU(d32, values + p * lanes)));
  }
  alignas(32) float sums[size];
  for (std::size_t p = 0; p < parts; ++p) hn::Store(hn::DemoteTo(d32, total[p]), d32, sums + p * lanes);
  bool any = false;
  for (std::size_t k = 0; k < TileGradient::sums; ++k) {
    rows.sums[k][i] = sums[k];
    any |= sums[k] != 0;
  }
  return any;
}

void ProjectRowsVjp(const scene::GaussianCloud& cloud, std::size_t first_row, const ViewParams<float>& view,
                    int sh_degree, const std::uint32_t* rows, const RowPairs& v_rows, std::size_t begin,
                    std::size_t end, Gradients& out) {
  const VjpD d;
  SeenRows seen;
  for (std::size_t r = begin; r < end; ++r) {
    const TileGradient *const first = v_rows.pairs + v_rows.first_pair[r], *const last =
                                                                               v_rows.pairs + v_rows.first_pair[r + 1];
    const std::size_t i = seen.count;
    if (!SumOverTiles(first, last, i, seen)) continue;
    ++seen.count;
    const std::size_t row = rows[r] - first_row;
    seen.slot[i] = std::uint32_t(r);
    seen.mean[0][i] = cloud.mean.x[row], seen.mean[1][i] = cloud.mean.y[row], seen.mean[2][i] = cloud.mean.z[row];
    seen.log_scale[0][i] = cloud.log_scale.x[row], seen.log_scale[1][i] = cloud.log_scale.y[row];
    seen.log_scale[2][i] = cloud.log_scale.z[row];
    seen.rotation[0][i] = cloud.rotation.w[row], seen.rotation[1][i] = cloud.rotation.x[row];
    seen.rotation[2][i] = cloud.rotation.y[row], seen.rotation[3][i] = cloud.rotation.z[row];
    seen.logit[i] = cloud.opacity_logit[row];
  }
  if (seen.count == 0) return;
  // What fills up the last vector: the last row once more.
  const std::size_t last = seen.count - 1;
  for (std::size_t i = seen.count; i % hn::Lanes(d) != 0; ++i) {
    for (auto& column : seen.mean) column[i] = column[last];
    for (auto& column : seen.log_scale) column[i] = column[last];
    for (auto& column : seen.rotation) column[i] = column[last];
    for (auto& column : seen.sums) column[i] = column[last];
    seen.logit[i] = seen.logit[last];
  }
  for (std::size_t i = 0; i < seen.count; i += hn::Lanes(d)) ProjectVjpVector(d, view, i, seen);

  switch (sh_degree) {
    case 0:
      ColorVjp<0>(cloud, first_row, rows, seen, out);
      break;
    case 1:
      ColorVjp<1>(cloud, first_row, rows, seen, out);
      break;
    case 2:
      ColorVjp<2>(cloud, first_row, rows, seen, out);
      break;
    default:
      ColorVjp<3>(cloud, first_row, rows, seen, out);
  }
  for (std::size_t i = 0; i < seen.count; ++i) {
    const std::size_t r = seen.slot[i];
    out.mean.x[r] += seen.v_mean[0][i], out.mean.y[r] += seen.v_mean[1][i], out.mean.z[r] += seen.v_mean[2][i];
    out.log_scale.x[r] += seen.v_log_scale[0][i], out.log_scale.y[r] += seen.v_log_scale[1][i];
    out.log_scale.z[r] += seen.v_log_scale[2][i];
    out.rotation.w[r] += seen.v_rotation[0][i], out.rotation.x[r] += seen.v_rotation[1][i];
    out.rotation.y[r] += seen.v_rotation[2][i], out.rotation.z[r] += seen.v_rotation[3][i];
    out.opacity_logit[r] += seen.v_logit[i];
    out.mean2d_x_px[r] = seen.v_x[i], out.mean2d_y_px[r] = seen.v_y[i];
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(ProjectRowsVjp);

void project_rows_vjp(const scene::GaussianCloud& cloud, std::size_t first_row, const ViewParams<float>& view,
                      int sh_degree, std::span<const std::uint32_t> rows, const RowPairs& v_rows, std::size_t begin,
                      std::size_t end, Gradients& out) {
  HWY_DYNAMIC_DISPATCH(ProjectRowsVjp)(cloud, first_row, view, sh_degree, rows.data(), v_rows, begin, end, out);
}

}  // namespace engine::render
#endif
