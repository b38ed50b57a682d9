#include "engine/io/scene_loss.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>

#include "engine/io/compressed_ply.h"
#include "engine/io/quantised.h"
#include "engine/io/splat.h"
#include "engine/io/spz.h"

namespace engine::io {
namespace {

/// What a format has room for, where that is not everything.
struct Room {
  StoredRange f_dc = {}, log_scales = {}, sh = {};
};

Room room_in(SceneFormat format) {
  switch (format) {
    case SceneFormat::splat:
      return {.f_dc = splat_f_dc, .log_scales = saturated_log_scales};
    case SceneFormat::spz:
      return {.f_dc = spz_f_dc, .log_scales = spz_log_scales, .sh = spz_sh};
    case SceneFormat::glb:
      return {.log_scales = saturated_log_scales};
    case SceneFormat::compressed_ply:
      return {.log_scales = saturated_log_scales, .sh = compressed_ply_sh};
    case SceneFormat::sog:  // its codebooks have the scene's own ends
    case SceneFormat::ply:
      break;
  }
  return {};
}

/// Largest and mean of differences that come one by one, and of those that are none of rounding.
struct Tally {
  double largest = 0, sum = 0, most_clipped = 0;
  std::size_t count = 0, clipped = 0;

  void add(double difference) {
    largest = std::max(largest, difference);
    sum += difference;
    ++count;
  }
  void add(double difference, bool held) {
    if (held) return add(difference);
    most_clipped = std::max(most_clipped, difference);
    ++clipped;
  }
  [[nodiscard]] AttributeLoss as(const char* attribute, const char* unit) const {
    const double all = double(count + clipped);
    return {attribute,   unit, largest, count == 0 ? 0 : sum / double(count), all == 0 ? 0 : double(clipped) / all,
            most_clipped};
  }
};

double opacity(float logit) { return 1.0 / (1.0 + std::exp(-double(logit))); }

/// Degrees between two rotations, up to half turns about local axes. By the sine of half of it: acos() of what is
/// nearly 1 knows no small angles.
double degrees_between(Quat a, Quat b) {
  const auto unit = [](Quat q) {
    const DQuat d(q);
    const double length = glm::length(d);
    return length > 0 ? d / length : DQuat(1, 0, 0, 0);
  };
  const DQuat turn = glm::conjugate(unit(a)) * unit(b);
  const std::array<double, 4> parts{turn.w, turn.x, turn.y, turn.z};
  double square = 0;
  for (const double part : parts) square += part * part;
  double largest = 0;
  for (const double part : parts) largest = std::max(largest, part * part);
  return 2 * std::asin(std::min(1.0, std::sqrt(std::max(0.0, square - largest)))) * 180 / std::numbers::pi;
}

}  // namespace

std::vector<AttributeLoss> scene_loss(const SceneFile& before, const SceneFile& after, SceneFormat format) {
  const scene::GaussianCloud &a = before.cloud, &b = after.cloud;
  assert(a.size() == b.size());
  const auto order = written_order(before, format);
  const std::size_t in = scene::sh_coefficients(a.sh_degree), out = scene::sh_coefficients(b.sh_degree);
  const Room room = room_in(format);
  Tally mean, scale, rotation, alpha, colour, sh;
  for (std::size_t j = 0; j < order.size(); ++j) {
    const std::size_t i = order[j];
    mean.add(glm::length(DVec3(a.mean.get(i)) - DVec3(b.mean.get(j))));
    for (int c = 0; c < 3; ++c) {
      const auto before_it = double(a.log_scale.get(i)[c]);
      scale.add(std::abs(before_it - double(b.log_scale.get(j)[c])), room.log_scales.holds(before_it));
    }
    rotation.add(degrees_between(a.rotation.get(i), b.rotation.get(j)));
    alpha.add(std::abs(opacity(a.opacity_logit[i]) - opacity(b.opacity_logit[j])));
    for (std::size_t c = 0; c < 3; ++c) {
      const auto dc = double(a.sh_row(i)[c * in]);
      colour.add(sh_c0 * std::abs(dc - double(b.sh_row(j)[c * out])), room.f_dc.holds(dc));
      for (std::size_t k = 1; k < std::min(in, out); ++k) {
        const auto before_it = double(a.sh_row(i)[c * in + k]);
        sh.add(std::abs(before_it - double(b.sh_row(j)[c * out + k])), room.sh.holds(before_it));
      }
    }
  }
  return {mean.as("positions", "world units"), scale.as("log scales", "natural logarithm"),
          rotation.as("rotations", "degrees"), alpha.as("opacities", "of 1"),
          colour.as("colours", "of 1"),        sh.as("SH", "as stored")};
}

}  // namespace engine::io
