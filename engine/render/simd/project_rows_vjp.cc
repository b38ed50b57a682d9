// The pullbacks of project_vjp.h, a vector of Gaussians at a time.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/project_rows_vjp.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: the math functions are compiled once per instruction set.
#include <hwy/contrib/math/math-inl.h>

#include "engine/render/simd/shade_rows.inc"

#include "engine/render/backward_stages.h"
#include "engine/render/project_vjp.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using VjpD = hn::ScalableTag<float>;
using VjpV = hn::Vec<VjpD>;

/// A block of the rows that may change, one array per value, and what becomes of them: all zero for rows that no tile
/// has or that change nothing.
struct VjpRows {
  static constexpr std::size_t room = project_vjp_block + 64;  // whole vectors are loaded and stored
  std::size_t count = 0;
  alignas(64) float mean[3][room], log_scale[3][room], rotation[4][room], logit[room];
  alignas(64) float sums[GroupGradient::sums][room];
  alignas(64) std::int32_t seen[room];  // not 0: some sum is not
  // out
  alignas(64) float v_mean[3][room], v_log_scale[3][room], v_rotation[4][room], v_logit[room], v_x[room], v_y[room];
  alignas(64) float to[3][room], inverse_distance[room];  // unit direction from the camera centre
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

/// project_vjp() and opacity_logit_gradient() for the rows [i, i + lanes). Those that are seen are visible; of all
/// others anything may come, infinities too, and is dropped.
HWY_INLINE void ProjectVjpVector(VjpD d, const ViewParams<float>& view, std::size_t i, VjpRows& rows) {
  const hn::RebindToSigned<VjpD> di;
  const auto seen = hn::RebindMask(d, hn::Ne(hn::Load(di, rows.seen + i), hn::Zero(di)));
  const auto store = [&](VjpV v, float* to) { hn::Store(hn::IfThenElseZero(seen, v), d, to + i); };
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
    store(hn::IfThenElseZero(inside, Dot(v_axis, axes[j])), rows.v_log_scale[j]);
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
    store(hn::IfThenElseZero(has_direction, tangent), rows.v_rotation[k]);
  }

  const VjpV v_x_over_z = hn::MulAdd(set(view.fx), v_x, hn::IfThenElseZero(hn::Eq(tx, x_over_z), v_tx));
  const VjpV v_y_over_z = hn::MulAdd(set(view.fy), v_y, hn::IfThenElseZero(hn::Eq(ty, y_over_z), v_ty));
  const VjpV shrinking = hn::MulAdd(v_x_over_z, x_over_z, hn::MulAdd(v_y_over_z, y_over_z, v_size));
  const V3 v_mean = rotated_back({hn::Mul(v_x_over_z, inverse_z), hn::Mul(v_y_over_z, inverse_z),
                                  hn::NegMulAdd(shrinking, inverse_z, load(rows.sums[9]))});
  store(v_mean.x, rows.v_mean[0]);
  store(v_mean.y, rows.v_mean[1]);
  store(v_mean.z, rows.v_mean[2]);
  store(v_x, rows.v_x);
  store(v_y, rows.v_y);

  const VjpV logit = load(rows.logit), bound = set(max_opacity_logit);
  const VjpV clear = hn::Div(one, hn::Add(one, hn::Exp(d, hn::Clamp(logit, hn::Neg(bound), bound))));  // 1 - opacity
  store(hn::IfThenElseZero(hn::Le(hn::Abs(logit), bound), hn::Mul(load(rows.sums[0]), clear)), rows.v_logit);

  const VjpV inverse_distance = hn::Div(one, hn::Sqrt(Dot(from_camera, from_camera)));
  const V3 to = Scaled(from_camera, inverse_distance);
  store(to.x, rows.to[0]);
  store(to.y, rows.to[1]);
  store(to.z, rows.to[2]);
  store(inverse_distance, rows.inverse_distance);
}

/// Bases of the rows' directions, and what they become: dL/dbasis.
struct Bases {
  alignas(64) Basis basis[project_vjp_block], v_basis[project_vjp_block];
};

/// Adds to the rows' v_mean what their direction gets from v_basis.
template <int kDegree>
HWY_INLINE void EachBasisVjp(const Bases& bases, VjpRows& rows) {
  for (std::size_t i = 0; i < rows.count; ++i) {
    const float to[3] = {rows.to[0][i], rows.to[1][i], rows.to[2][i]};
    const auto v_to = scene::sh_basis_vjp(kDegree, to[0], to[1], to[2], bases.v_basis[i]);
    const float along = v_to[0] * to[0] + v_to[1] * to[1] + v_to[2] * to[2];
    for (std::size_t axis = 0; axis < 3; ++axis)
      rows.v_mean[axis][i] += (v_to[axis] - along * to[axis]) * rows.inverse_distance[i];
  }
}

/// color_vjp() for row i, which is seen, up to the basis: adds to v_sh and writes v_basis.
///   sh, v_sh  [3 * stored]
template <int kDegree>
HWY_INLINE void ColorVjpRow(const float* sh, std::size_t stored, std::size_t i, const VjpRows& rows, Bases& bases,
                            float* v_sh) {
  const CoefficientD<kDegree> d;
  constexpr std::size_t used = scene::sh_coefficients(kDegree);
  const float* const basis = bases.basis[i];
  float* const v_basis = bases.v_basis[i];
  float color[3], v_color[3];
  ShadeRow<kDegree>(sh, stored, basis, color);
  for (std::size_t c = 0; c < 3; ++c)
    v_color[c] = color[c] >= 0 && color[c] <= float(max_color) ? rows.sums[6 + c][i] : 0.0f;  // nothing for NaN
  const auto each = [&](auto any, std::size_t k) {
    const auto b = hn::Load(any, basis + k);
    auto v_b = hn::Zero(any);
    for (std::size_t c = 0; c < 3; ++c) {
      if (v_color[c] == 0) continue;  // nor may its coefficients matter
      const auto v = hn::Set(any, v_color[c]);
      hn::StoreU(hn::MulAdd(v, b, hn::LoadU(any, v_sh + c * stored + k)), any, v_sh + c * stored + k);
      v_b = hn::MulAdd(v, hn::LoadU(any, sh + c * stored + k), v_b);
    }
    hn::Store(v_b, any, v_basis + k);
  };
  std::size_t k = 0;
  for (; k + hn::Lanes(d) <= used; k += hn::Lanes(d)) each(d, k);
  for (; k < used; ++k) each(hn::CappedTag<float, 1>(), k);
}

/// color_vjp() for all rows, whose directions are known: adds to their v_mean, and to out.sh.
///   row_of  [rows.count] in the layers, ascending
template <int kDegree>
void ColorVjp(const scene::GaussianCloud& cloud, std::size_t first_row, const std::uint32_t* row_of, std::size_t begin,
              VjpRows& rows, Gradients& out) {
  const std::size_t stored = scene::sh_coefficients(cloud.sh_degree), stride = cloud.sh_stride();
  Bases bases;
  EachBasis<kDegree>(rows.to[0], rows.to[1], rows.to[2], rows.count, bases.basis);
  const auto sh = [&](std::size_t i) { return cloud.sh.data() + (row_of[i] - first_row) * stride; };
  const auto v_sh = [&](std::size_t i) { return out.sh.data() + (begin + i) * stride; };
  for (std::size_t i = 0; i < rows.count; ++i) {
    const std::size_t coming = HWY_MIN(i + 8, rows.count - 1);
    if (rows.seen[coming] != 0) FetchRow(sh(coming), stride), FetchRow(v_sh(coming), stride);
    if (rows.seen[i] != 0)
      ColorVjpRow<kDegree>(sh(i), stored, i, rows, bases, v_sh(i));
    else
      std::fill_n(bases.v_basis[i], basis_size, 0.0f);
  }
  EachBasisVjp<kDegree>(bases, rows);
}

/// Sums a row's gradients over its groups of tiles, in their order and in double, into row i, and leaves zeros there.
/// False if all are zero.
HWY_INLINE bool SumOverGroups(GroupGradient* first, GroupGradient* last, std::size_t i, VjpRows& rows) {
  constexpr std::size_t size = sizeof(GroupGradient) / sizeof(float);
  const hn::CappedTag<double, 4> d64;
  const hn::Rebind<float, decltype(d64)> d32;
  constexpr std::size_t lanes = hn::MaxLanes(d64), parts = size / lanes;
  hn::Vec<decltype(d64)> total[parts];
  for (auto& part : total) part = hn::Zero(d64);
  constexpr std::ptrdiff_t ahead = 16;  // rows' pairs follow each other
  for (; first != last; ++first) {
    hwy::Prefetch(first + ahead);
    auto* const values = reinterpret_cast<float*>(first);
    for (std::size_t p = 0; p < parts; ++p) {
      total[p] = hn::Add(total[p], hn::PromoteTo(d64, hn::LoadU(d32, values + p * lanes)));
      hn::StoreU(hn::Zero(d32), d32, values + p * lanes);
    }
  }
  alignas(32) float sums[size];
  bool any = false;
  for (std::size_t p = 0; p < parts; ++p) {
    const auto part = hn::DemoteTo(d32, total[p]);
    hn::Store(part, d32, sums + p * lanes);
    any |= !hn::AllTrue(d32, hn::Eq(part, hn::Zero(d32)));
  }
  for (std::size_t k = 0; k < GroupGradient::sums; ++k) rows.sums[k][i] = sums[k];
  return any;
}

/// What is stored of the rows.
///   row_of  [rows.count] in the layers, ascending
HWY_INLINE void LoadRows(const scene::GaussianCloud& cloud, std::size_t first_row, const std::uint32_t* row_of,
                         VjpRows& rows) {
  const bool side_by_side = row_of[rows.count - 1] - row_of[0] == rows.count - 1;
  const auto load = [&](const std::vector<float>& from, float* to) {
    if (side_by_side)
      std::copy_n(from.data() + (row_of[0] - first_row), rows.count, to);
    else
      for (std::size_t i = 0; i < rows.count; ++i) to[i] = from[row_of[i] - first_row];
  };
  load(cloud.mean.x, rows.mean[0]), load(cloud.mean.y, rows.mean[1]), load(cloud.mean.z, rows.mean[2]);
  load(cloud.log_scale.x, rows.log_scale[0]), load(cloud.log_scale.y, rows.log_scale[1]);
  load(cloud.log_scale.z, rows.log_scale[2]);
  load(cloud.rotation.w, rows.rotation[0]), load(cloud.rotation.x, rows.rotation[1]);
  load(cloud.rotation.y, rows.rotation[2]), load(cloud.rotation.z, rows.rotation[3]);
  load(cloud.opacity_logit, rows.logit);
}

/// What fills up the last vector: rows that are not seen.
HWY_INLINE void FillUp(VjpD d, VjpRows& rows) {
  for (std::size_t i = rows.count; i % hn::Lanes(d) != 0; ++i) {
    for (auto& column : rows.mean) column[i] = 0;
    for (auto& column : rows.log_scale) column[i] = 0;
    for (auto& column : rows.rotation) column[i] = 0;
    for (auto& column : rows.sums) column[i] = 0;
    rows.logit[i] = 0, rows.seen[i] = 0;
  }
}

void ProjectRowsVjp(const scene::GaussianCloud& cloud, std::size_t first_row, const ViewParams<float>& view,
                    int sh_degree, const std::uint32_t* row_of, const RowPairs& v_rows, std::size_t begin,
                    std::size_t end, Gradients& out) {
  const VjpD d;
  VjpRows rows;
  rows.count = end - begin;
  row_of += begin;
  bool any = false;
  for (std::size_t i = 0; i < rows.count; ++i) {
    const std::uint32_t* const first_pair = v_rows.first_pair + begin + i;
    const bool seen = SumOverGroups(v_rows.pairs + first_pair[0], v_rows.pairs + first_pair[1], i, rows);
    rows.seen[i] = seen ? 1 : 0;
    any |= seen;
  }
  if (!any) {
    std::fill_n(out.mean2d_x_px.data() + begin, rows.count, 0.0f);
    std::fill_n(out.mean2d_y_px.data() + begin, rows.count, 0.0f);
    return;
  }
  LoadRows(cloud, first_row, row_of, rows);
  FillUp(d, rows);
  for (std::size_t i = 0; i < rows.count; i += hn::Lanes(d)) ProjectVjpVector(d, view, i, rows);
  WithDegree(sh_degree, [&](auto degree) { ColorVjp<degree>(cloud, first_row, row_of, begin, rows, out); });
  const auto add = [&](const float* from, std::vector<float>& to) {
    for (std::size_t i = 0; i < rows.count; ++i) to[begin + i] += from[i];
  };
  add(rows.v_mean[0], out.mean.x), add(rows.v_mean[1], out.mean.y), add(rows.v_mean[2], out.mean.z);
  add(rows.v_log_scale[0], out.log_scale.x), add(rows.v_log_scale[1], out.log_scale.y);
  add(rows.v_log_scale[2], out.log_scale.z);
  add(rows.v_rotation[0], out.rotation.w), add(rows.v_rotation[1], out.rotation.x);
  add(rows.v_rotation[2], out.rotation.y), add(rows.v_rotation[3], out.rotation.z);
  add(rows.v_logit, out.opacity_logit);
  std::copy_n(rows.v_x, rows.count, out.mean2d_x_px.data() + begin);
  std::copy_n(rows.v_y, rows.count, out.mean2d_y_px.data() + begin);
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
