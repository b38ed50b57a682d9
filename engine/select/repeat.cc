#include "engine/select/repeat.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "engine/core/median.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/neighbours/point_index.h"
#include "engine/render/project.h"
#include "engine/select/similarity.h"

namespace engine::select {
namespace {

constexpr std::size_t neighbours_joined = 8;  // the next ring of a surface
// Of nine in ten rows of a part's border, how much farther across the pull one looks: borders are ragged.
constexpr double wider = 1.2;
// In radii of the border: how much of the rest is looked at, and the shortest and longest period. A shorter one is a
// slice, which looks like the next one on any surface; longer ones than twice the width repeat nothing that is seen.
constexpr double looked_at = 6, shortest = 1, longest = 4;
// Of what is there: the longest period. A third at least is compared.
constexpr double longest_part = 2.0 / 3.0;
constexpr std::size_t most_periods = 64, most_samples = 400;  // choices: more of them tell no more
// A place is on a surface if one of its rows is no farther than so many of their spacings.
constexpr double on_surface = 1.5;
// What repeats has a surface in all but so many of the places,
constexpr double most_missing = 0.15;
// and looks there at most so many times as unlike as it does one row further on, as a plain pole; or so much less
// unlike than after other lengths, as a pattern. The neck of a guitar: 1.7. A fox's snout: 2.6, and a fifth of it is
// missing. The captured case rod: 0.6, by a zigzag as fine as its Gaussians. Chosen on these.
constexpr double plain = 2, plain_at_most = 0.4, in_pattern = 0.7;
// Periods that are as good as the best one, and slabs of the part that go on as it does.
constexpr double as_good = 1.15, as_good_at_least = 0.01, going_on = 0.05;

/// Where a part meets the rest.
struct Mouth {
  double level = 0;  ///< Along the pull.
  DVec3 middle{0.0};
  double radius = 0;  ///< Across the pull, with some more.
};

double across(DVec3 offset, DVec3 along) { return glm::length(offset - glm::dot(offset, along) * along); }

double quantile(std::vector<double> values, double part) {
  const auto at = values.begin() + std::ptrdiff_t(part * double(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// None where nothing touches.
std::optional<Mouth> mouth_of(const Array3& means, std::span<const std::uint32_t> part, std::span<const Touch> touches,
                              DVec3 along) {
  std::vector<DVec3> border;
  std::vector<double> levels;
  for (std::size_t k = 0; k < part.size(); ++k)
    if (touches[k] != Touch::nothing) border.emplace_back(means.get(part[k]));
  if (border.empty()) return std::nullopt;
  for (const DVec3& mean : border) levels.push_back(glm::dot(mean, along));
  // What touches something else far ahead says nothing of it.
  const double low = quantile(levels, 0.25), high = quantile(levels, 0.75), ragged = high - low;
  std::erase_if(border, [&](const DVec3& mean) {
    const double level = glm::dot(mean, along);
    return level < low - ragged || level > high + ragged;
  });
  Mouth mouth;
  mouth.level = high;
  for (const DVec3& mean : border) mouth.middle += mean / double(border.size());
  std::vector<double> radii;
  for (const DVec3& mean : border) radii.push_back(across(mean - mouth.middle, along));
  mouth.radius = wider * quantile(std::move(radii), 0.9);
  return mouth;
}

/// The rows around the line through the mouth, as far behind it as is looked at; ascending.
std::vector<std::uint32_t> rows_behind(const Array3& means, const Mouth& mouth, DVec3 along) {
  std::vector<std::uint32_t> out;
  for (std::uint32_t row = 0; row < means.size(); ++row) {
    const DVec3 mean(means.get(row));
    const double level = glm::dot(mean, along);
    if (level < mouth.level && level >= mouth.level - looked_at * mouth.radius &&
        across(mean - mouth.middle, along) <= mouth.radius)
      out.push_back(row);
  }
  return out;
}

/// How much of a picture a row can fill: its opacity times the product of its two longer axes.
float shown_by(const scene::GaussianCloud& cloud, std::size_t row) {
  // Sums of them and quotients by squared distances are floats.
  constexpr float least = 1e-18f, most = 1e18f, most_log = 80;
  const Vec3 log_scale = cloud.log_scale.get(row);
  const float thinnest = std::min({log_scale.x, log_scale.y, log_scale.z});
  const float area = std::exp(std::clamp(log_scale.x + log_scale.y + log_scale.z - thinnest, -most_log, most_log));
  return std::clamp(render::opacity<float>(cloud.opacity_logit[row]) * area, least, most);
}

/// What is seen at a place.
struct Look {
  bool is_there = false;  ///< A surface is.
  Vec3 color{0.0f};
};

/// Some rows of the scene, and what they show anywhere near them.
class Surface {
 public:
  Surface(const scene::LayeredCloud& scene, std::vector<std::uint32_t> rows)
      : rows_(std::move(rows)),
        cloud_(scene::gather(scene, rows_)),
        origin_(cloud_.mean.get(0)),
        points_(points()),
        index_(points_, 3),
        graph_(neighbours::join_nearest(points_, index_, neighbours_joined, /*bridged=*/false)),
        spacing_(double(median(graph_.spacing))) {
    for (std::size_t k = 0; k < size(); ++k)
      color_.push_back(color_of(cloud_, k)), weight_.push_back(shown_by(cloud_, k));
  }

  [[nodiscard]] std::size_t size() const { return rows_.size(); }
  [[nodiscard]] const std::vector<std::uint32_t>& rows() const { return rows_; }
  [[nodiscard]] DVec3 mean(std::size_t k) const { return DVec3(cloud_.mean.get(k)); }
  [[nodiscard]] double spacing() const { return spacing_; }  ///< As is usual, world units.

  [[nodiscard]] std::vector<Look> look(std::span<const DVec3> places) const {
    std::vector<float> queries;
    for (const DVec3& place : places)
      for (const float value : neighbours::point_of(place, origin_)) queries.push_back(value);
    const std::size_t asked = std::min(neighbours_joined, index_.size());
    const std::vector<neighbours::Neighbour> found = index_.nearest(queries, asked);
    const auto blurred = float(0.25 * spacing_ * spacing_);  // a row that is hit exactly is not all there is to see
    std::vector<Look> out(places.size());
    for (std::size_t k = 0; k < places.size(); ++k) {
      float sum = 0;
      for (const neighbours::Neighbour& near : std::span(found).subspan(k * asked, asked)) {
        const double reach = on_surface * std::max(double(graph_.spacing[near.index]), spacing_);
        out[k].is_there = out[k].is_there || double(near.squared_distance) <= reach * reach;
        // Rows in one place have no spacing: then all that are there count alike.
        const float weight = weight_[near.index] / std::max(near.squared_distance + blurred, 1e-18f);
        out[k].color += weight * color_[near.index];
        sum += weight;
      }
      out[k].color /= sum;
    }
    return out;
  }

  /// The rows of the largest piece that hangs together; ascending.
  [[nodiscard]] std::vector<std::uint32_t> largest_piece() const {
    neighbours::Pieces pieces(size());
    for (std::uint32_t node = 0; node < size(); ++node)
      for (std::uint32_t edge = graph_.begin[node]; edge < graph_.begin[node + 1]; ++edge) {
        const std::uint32_t other = graph_.to[edge];
        const float spacing = std::max(graph_.spacing[node], graph_.spacing[other]);
        if (graph_.length[edge] <= neighbours::joining_spacings * spacing) pieces.join(node, other);
      }
    const std::vector<std::uint32_t> sizes = pieces.sizes();
    const auto largest = std::uint32_t(std::ranges::max_element(sizes) - sizes.begin());
    std::vector<std::uint32_t> out;
    for (std::uint32_t node = 0; node < size(); ++node)
      if (pieces.of(node) == largest) out.push_back(rows_[node]);
    return out;
  }

 private:
  [[nodiscard]] std::vector<float> points() const {
    std::vector<std::uint32_t> all(rows_.size());
    std::iota(all.begin(), all.end(), 0u);
    return neighbours::points_of(cloud_.mean, all, origin_);
  }

  std::vector<std::uint32_t> rows_;
  scene::GaussianCloud cloud_;
  DVec3 origin_;
  std::vector<float> points_;
  neighbours::PointIndex index_;
  neighbours::NeighbourGraph graph_;
  double spacing_;
  std::vector<Vec3> color_;
  std::vector<float> weight_;
};

/// How much of what is somewhere is elsewhere, too.
struct Match {
  double missing = 1;  ///< Part of the places, 0 to 1, that have no surface there.
  double unlike = 3;   ///< Of the others: the difference of colours over three channels, 0 to 3, on average.
};

Match match(std::span<const Look> here, std::span<const Look> there) {
  std::size_t both = 0;
  double sum = 0;
  for (std::size_t k = 0; k < here.size(); ++k) {
    if (!here[k].is_there || !there[k].is_there) continue;
    const Vec3 off = glm::abs(here[k].color - there[k].color);
    sum += double(off.x + off.y + off.z);
    ++both;
  }
  if (both == 0) return {};
  return {1 - double(both) / double(here.size()), sum / double(both)};
}

/// What is before the mouth, by its level.
class Way {
 public:
  Way(const Surface& surface, DVec3 along, double end) : surface_(surface), along_(along), begin_(end), end_(end) {
    for (std::size_t k = 0; k < surface.size(); ++k) {
      level_.push_back(glm::dot(surface.mean(k), along));
      begin_ = std::min(begin_, level_.back());
    }
  }
  [[nodiscard]] double length() const { return end_ - begin_; }

  /// How the last of the way comes back when it is shifted back by `shift`, and what is there when that is shifted
  /// ahead: nothing may be there that does not come back.
  [[nodiscard]] Match after(double shift) const {
    const double window = std::max(length() - shift, length() / 3);
    const Match back = after(-shift, end_ - window);
    const Match ahead = after(shift, std::max(begin_, end_ - window - shift));
    return {0.5 * (back.missing + ahead.missing), 0.5 * (back.unlike + ahead.unlike)};
  }

 private:
  [[nodiscard]] Match after(double shift, double from) const {
    const double to = std::min(end_, shift > 0 ? end_ - shift : end_);
    std::vector<std::size_t> between;
    for (std::size_t k = 0; k < level_.size(); ++k)
      if (level_[k] >= from && level_[k] < to) between.push_back(k);
    const std::size_t samples = std::min(between.size(), most_samples);
    std::vector<DVec3> places;
    for (std::size_t k = 0; k < samples; ++k) places.push_back(surface_.mean(between[k * between.size() / samples]));
    const std::vector<Look> here = surface_.look(places);
    for (DVec3& place : places) place += shift * along_;
    return match(here, surface_.look(places));
  }

  const Surface& surface_;
  DVec3 along_;
  double begin_, end_;
  std::vector<double> level_;
};

struct Period {
  double length = 0;
  double unlike = 0;  ///< Match::unlike after it.
};

/// The longest of those after which the way comes back best.
std::optional<Period> period_of(const Way& way, double radius, double spacing) {
  const double first = std::max(shortest * radius, 2 * spacing);
  const double last = std::min(longest * radius, longest_part * way.length());
  const double step = std::max(spacing, last / double(most_periods));
  std::vector<Period> periods;
  std::vector<double> shorter_unlike;  // [periods] the most unlike after any shorter length
  double most_unlike = 0;
  for (double length = step; length <= last; length += step) {
    const Match found = way.after(length);
    if (length >= first && found.missing <= most_missing)
      periods.push_back({length, found.unlike}), shorter_unlike.push_back(most_unlike);
    most_unlike = std::max(most_unlike, found.unlike);
  }
  if (periods.empty()) return std::nullopt;
  const auto best = std::size_t(std::ranges::min_element(periods, {}, &Period::unlike) - periods.begin());
  const double least = periods[best].unlike, nearby = way.after(spacing).unlike;
  const bool is_plain = least <= std::min(plain * nearby, plain_at_most);
  if (!is_plain && least > in_pattern * shorter_unlike[best]) return std::nullopt;
  Period out;
  for (const Period& period : periods)
    if (period.unlike <= as_good * least + as_good_at_least) out = period;
  return out;
}

/// How far the part goes on as the rest before the mouth does, slab by slab: a level.
double cut_of(const scene::LayeredCloud& scene, const Array3& means, std::span<const std::uint32_t> part,
              const Surface& surface, const Mouth& mouth, Period period, DVec3 along, double limit) {
  const double thickness = 2 * surface.spacing();
  std::vector<std::uint32_t> both;
  std::ranges::set_union(surface.rows(), part, std::back_inserter(both));
  const Surface whole(scene, std::move(both));
  double cut = mouth.level;
  while (cut + thickness <= limit) {
    std::vector<DVec3> here, earlier;
    for (const std::uint32_t row : part) {
      const DVec3 mean(means.get(row));
      const double level = glm::dot(mean, along);
      if (level < cut || level >= cut + thickness) continue;
      const double periods = std::floor((level - mouth.level) / period.length) + 1;
      here.push_back(mean), earlier.push_back(mean - periods * period.length * along);
    }
    if (here.empty()) break;
    const Match found = match(whole.look(here), surface.look(earlier));
    if (found.missing > most_missing || found.unlike > period.unlike + going_on) break;
    cut += thickness;
  }
  return cut;
}

/// How far before the cut what is there is not what comes back: a rim, a nut at the end of a neck. At most half a
/// period.
double irregular_before(const Surface& surface, double cut, Period period, DVec3 along) {
  const double thickness = 2 * surface.spacing();
  for (double depth = 0; depth <= period.length / 2; depth += thickness) {
    std::vector<DVec3> here, earlier;
    for (std::size_t k = 0; k < surface.size(); ++k) {
      const DVec3 mean = surface.mean(k);
      const double at = cut - glm::dot(mean, along);
      if (at > depth && at <= depth + thickness) here.push_back(mean), earlier.push_back(mean - period.length * along);
    }
    if (here.empty()) continue;
    const Match found = match(surface.look(here), surface.look(earlier));
    if (found.missing <= most_missing && found.unlike <= period.unlike + going_on) return depth;
  }
  return 0;
}

}  // namespace

std::optional<Repeat> find_repeat(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part,
                                  std::span<const Touch> touches, DVec3 pull, double limit) {
  assert(touches.size() == part.size() && pull != DVec3(0.0));
  const DVec3 along = glm::normalize(pull);
  const Array3 means = scene::means(scene);
  const auto mouth = mouth_of(means, part, touches, along);
  if (!mouth) return std::nullopt;
  std::vector<std::uint32_t> behind = rows_behind(means, *mouth, along);
  if (behind.empty()) return std::nullopt;
  const Surface surface(scene, Surface(scene, std::move(behind)).largest_piece());
  if (!(surface.spacing() > 0)) return std::nullopt;  // most rows are in one place: there is no surface
  const auto period = period_of(Way(surface, along, mouth->level), mouth->radius, surface.spacing());
  if (!period) return std::nullopt;

  const double cut = cut_of(scene, means, part, surface, *mouth, *period, along, limit);
  const auto depth_of = [&](std::uint32_t row) { return cut - glm::dot(DVec3(means.get(row)), along); };
  Repeat repeat;
  repeat.step = period->length * along;
  for (const std::uint32_t row : part)
    if (depth_of(row) > 0) repeat.stays.push_back(row);
  std::vector<std::uint32_t> before;
  std::ranges::set_union(surface.rows(), repeat.stays, std::back_inserter(before));
  const double skipped = irregular_before(surface, cut, *period, along);
  for (const std::uint32_t row : before)
    if (const double depth = depth_of(row); depth > skipped && depth <= skipped + period->length)
      repeat.tile.push_back(row), repeat.depth.push_back(depth);
  if (repeat.tile.empty()) return std::nullopt;
  return repeat;
}

}  // namespace engine::select
