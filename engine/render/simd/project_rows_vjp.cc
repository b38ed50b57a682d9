// Pullback of the projection of rows of Gaussians, a vector of them at a time: the formulas of
// engine/render/projection_vjp.inc, between the sums over groups of tiles and the gradients of what is stored.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/project_rows_vjp.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/simd/lanes.inc"
#include "engine/render/simd/shade_rows.inc"

#include <algorithm>

#include "engine/render/backward_stages.h"
#include "engine/render/project_vjp.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

#include "engine/render/projection.inc"
#include "engine/render/projection_vjp.inc"

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

/// From K d as Splat has it, with |K d|^2 = q log2(e) / 2, to standard deviations: sqrt(2 ln 2), and its square.
constexpr double sigmas_of_splat = 1.1774100225154747, square_sigmas_of_splat = 1.3862943611198906;

/// dL/d(projection) from the sums over pixels, which GroupGradient has in the units of Splat: see projection_gradient()
/// in blend.h.
///   load  load(k) is sum k of GroupGradient
template <class LoadSum>
HWY_INLINE ProjectionGradient<Lanes> GradientOfProjection(const Reprojection<Lanes>& of, LoadSum&& load) {
  const Lanes along = load(1) * Lanes(sigmas_of_splat), across = load(2) * Lanes(sigmas_of_splat);
  const FalloffMatrix<Lanes>& K = of.K;
  return {.x = K.l1 * of.cov.inverse_unit * along,
          .y = mul_add(K.l2, along, K.l3 * across) * of.cov.inverse_unit,
          .depth = load(9),
          .strain_11 = load(3) * Lanes(square_sigmas_of_splat),
          .strain_12 = load(4) * Lanes(square_sigmas_of_splat),
          .strain_22 = load(5) * Lanes(square_sigmas_of_splat)};
}

/// project_vjp() and logit_vjp() for the rows [i, i + lanes), and where they are seen from. Those that are seen are
/// visible; of all others anything may come, infinities too, and is dropped.
HWY_INLINE void ProjectVjpVector(const ViewParams<float>& view, std::size_t i, VjpRows& rows) {
  const LanesD any;
  const hn::RebindToSigned<LanesD> di;
  const Mask seen = hn::RebindMask(any, hn::Ne(hn::Load(di, rows.seen + i), hn::Zero(di)));
  const auto load = [&](const float* from) { return Lanes(hn::Load(any, from + i)); };
  const auto load_three = [&](const auto& from) { return Vector<Lanes>{load(from[0]), load(from[1]), load(from[2])}; };
  const auto store = [&](Lanes value, float* to) { hn::Store(where<Lanes>(seen, value).v, any, to + i); };

  const Vector<Lanes> log_scale = load_three(rows.log_scale);
  const auto& q = rows.rotation;
  const Reprojection<Lanes> of =
      reproject<Lanes>(view, load_three(rows.mean), log_scale, {load(q[0]), load(q[1]), load(q[2]), load(q[3])});
  const ProjectionGradient<Lanes> v_out = GradientOfProjection(of, [&](std::size_t k) { return load(rows.sums[k]); });
  const GaussianGradient<Lanes> v = project_vjp(view, of, log_scale, v_out);
  for (std::size_t k = 0; k < 3; ++k) store(v.mean[k], rows.v_mean[k]), store(v.log_scale[k], rows.v_log_scale[k]);
  for (std::size_t k = 0; k < 4; ++k) store(v.rotation[k], rows.v_rotation[k]);
  store(v_out.x, rows.v_x), store(v_out.y, rows.v_y);
  store(logit_vjp(load(rows.logit), load(rows.sums[0])), rows.v_logit);

  const auto [to, inverse_distance] = direction(of.d);
  for (std::size_t k = 0; k < 3; ++k) store(to[k], rows.to[k]);
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
    const std::array<float, 3> to{rows.to[0][i], rows.to[1][i], rows.to[2][i]};
    const auto v_to = scene::sh_basis_vjp(kDegree, to[0], to[1], to[2], bases.v_basis[i]);
    const auto v_mean = direction_vjp(to, rows.inverse_distance[i], v_to);
    for (std::size_t axis = 0; axis < 3; ++axis) rows.v_mean[axis][i] += v_mean[axis];
  }
}

/// color_vjp() for row i, which is seen, up to the basis: adds to v_sh and writes v_basis,
///   v_sh_ck += v_color_c Y_k,   v_Y_k = sum_c v_color_c sh_ck,
/// in lanes of coefficients: see shade_rows.inc.
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
HWY_INLINE void FillUp(VjpRows& rows) {
  for (std::size_t i = rows.count; i % hn::Lanes(LanesD()) != 0; ++i) {
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
  FillUp(rows);
  for (std::size_t i = 0; i < rows.count; i += hn::Lanes(LanesD())) ProjectVjpVector(view, i, rows);
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
