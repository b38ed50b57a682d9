#include "engine/procedural/surfels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace engine::procedural {
namespace {

constexpr float skin = 0.004f;        // visibility rays end this far off a surface, clear of its own mesh
constexpr float overlap = 0.68f;      // sigma over spacing: less than 3 % shines through between neighbours
constexpr float edge_overlap = 0.5f;  // the same towards an open edge, so that edges stay crisp
constexpr float jitter = 0.12f;       // of the spacing: breaks the rows, opens no holes

/// A patch where it stands, with the arc lengths by which rows are laid.
struct Ground {
  const Object* object;
  const Patch* patch;
  Placement turned;             ///< The object's rotation alone, for directions.
  std::vector<float> length_v;  ///< Mean arc length up to v = i / (size - 1).
};

/// A row of Gaussians along u.
struct Row {
  std::uint32_t ground = 0;
  float v = 0, step_v = 0;           ///< Middle of the row; its part of v.
  float spacing_v = 0;               ///< World units between rows.
  bool first = false, last = false;  ///< At the end of v.
  float shift = 0;                   ///< Of its Gaussians along u, in steps: neighbouring rows interlock.
  std::vector<float> length_u;       ///< Arc length up to u = i / (size - 1), world units.
  std::uint32_t count = 0;
  std::size_t begin = 0;  ///< Number of its first Gaussian.
};

/// A point of a surface where a Gaussian may go.
struct Site {
  std::uint32_t ground = 0;
  float u = 0, v = 0, step_u = 0, step_v = 0;
  float sigma_u = 0, sigma_v = 0;
  bool is_used = false;
};

struct Eye {
  Vec3 centre;
  Mat3 rotation;
  float fx, fy, cx, cy, width, height;
};

std::vector<float> arc_lengths(int cells, const std::function<Vec3(float)>& curve) {
  std::vector<float> length(std::size_t(cells) + 1, 0.0f);
  Vec3 last = curve(0);
  for (std::size_t i = 1; i < length.size(); ++i) {
    const Vec3 here = curve(float(i) / float(cells));
    length[i] = length[i - 1] + glm::length(here - last);
    last = here;
  }
  return length;
}

/// Where along a curve (0 to 1) a given arc length is reached.
float parameter_at(const std::vector<float>& length, float wanted) {
  const auto after = std::upper_bound(length.begin() + 1, length.end() - 1, wanted);
  const auto i = std::size_t(after - length.begin());
  const float step = length[i] - length[i - 1];
  const float t = step > 0 ? (wanted - length[i - 1]) / step : 0.0f;
  return (float(i - 1) + t) / float(length.size() - 1);
}

std::vector<Ground> lay_ground(std::span<const Object> objects) {
  std::vector<Ground> grounds;
  for (const Object& object : objects)
    for (const Patch& patch : object.patches) {
      Ground ground{&object, &patch, {Vec3(0.0f), object.placement.turn_rad}, {}};
      const int cells = patch.cells_v == 1 ? 1 : 4 * patch.cells_v;
      constexpr int meridians = 4;
      for (int k = 0; k < meridians; ++k) {
        const float u = (float(k) + 0.5f) / meridians;
        const auto length = arc_lengths(cells, [&](float v) { return patch.position(u, v); });
        ground.length_v.resize(length.size());
        for (std::size_t i = 0; i < length.size(); ++i) ground.length_v[i] += length[i] / float(meridians);
      }
      grounds.push_back(std::move(ground));
    }
  return grounds;
}

/// Rows over all patches, for Gaussians `spacing` apart where the density is 1.
std::vector<Row> lay_rows(const std::vector<Ground>& grounds, float spacing) {
  std::vector<std::vector<Row>> per_ground(grounds.size());
  parallel_for(grounds.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      const Patch& patch = *grounds[g].patch;
      const std::vector<float>& length_v = grounds[g].length_v;
      const float apart = spacing / std::sqrt(patch.density);
      const int rows = std::max(1, int(std::lround(length_v.back() / apart)));
      for (int k = 0; k < rows; ++k) {
        Row row;
        row.ground = std::uint32_t(g);
        row.spacing_v = length_v.back() / float(rows);
        row.v = parameter_at(length_v, (float(k) + 0.5f) * row.spacing_v);
        row.step_v =
            parameter_at(length_v, float(k + 1) * row.spacing_v) - parameter_at(length_v, float(k) * row.spacing_v);
        row.first = k == 0;
        row.last = k == rows - 1;
        row.shift = patch.closed_u && k % 2 == 1 ? 0.5f : 0.0f;
        const int cells = patch.cells_u == 1 ? 1 : 2 * patch.cells_u;
        row.length_u = arc_lengths(cells, [&](float u) { return patch.position(u, row.v); });
        row.count = std::uint32_t(std::max(1L, std::lround(row.length_u.back() / apart)));
        per_ground[g].push_back(std::move(row));
      }
    }
  });
  std::vector<Row> all;
  std::size_t begin = 0;
  for (auto& rows : per_ground)
    for (Row& row : rows) {
      row.begin = begin;
      begin += row.count;
      all.push_back(std::move(row));
    }
  return all;
}

/// Does the camera see the middle of a Gaussian? Where it is large in the picture, other spots of it will do as well:
/// at the foot of an object half a Gaussian may show while its middle is covered.
///   reach  of the Gaussian, world units: one just outside the picture still reaches into it
bool sees(const Eye& eye, const Occluders& occluders, Vec3 middle, std::span<const Vec3> spots, float reach) {
  constexpr float near_plane = 0.2f;  // splatting draws nothing nearer to the camera than this
  constexpr float large_px = 6;
  const Vec3 in_cam = eye.rotation * (middle - eye.centre);
  if (in_cam.z < near_plane) return false;
  const float reach_px = reach * eye.fx / in_cam.z;
  const float x = eye.fx * in_cam.x / in_cam.z + eye.cx, y = eye.fy * in_cam.y / in_cam.z + eye.cy;
  if (x < -reach_px || y < -reach_px || x > eye.width + reach_px || y > eye.height + reach_px) return false;
  if (!occluders.any(middle, eye.centre - middle, 1.0f)) return true;
  return reach_px > large_px && std::any_of(spots.begin(), spots.end(),
                                            [&](Vec3 spot) { return !occluders.any(spot, eye.centre - spot, 1.0f); });
}

/// Is the Gaussian visible from some camera?
///   first  the camera to begin with; on success, the one that sees it: likely the one that sees its neighbour, too
bool is_seen(const Ground& ground, const Site& site, std::span<const Eye> eyes, const Occluders& occluders, Rng& rng,
             std::size_t& first) {
  const Vec3 point = ground.object->placement.world(ground.patch->position(site.u, site.v));
  const Vec3 normal = ground.turned.world(normal_at(*ground.patch, site.u, site.v));
  const Vec3 axis = std::abs(normal.x) < 0.5f ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
  const Vec3 right = glm::normalize(glm::cross(normal, axis)), up = glm::cross(normal, right);
  const float reach = 3 * std::max(site.sigma_u, site.sigma_v);
  for (std::size_t k = 0; k < eyes.size(); ++k) {
    const std::size_t number = (first + k) % eyes.size();
    const float facing = glm::dot(normal, eyes[number].centre - point);
    const float radius = 1.5f * std::sqrt(rng.uniform()), angle = 2 * std::numbers::pi_v<float> * rng.uniform();
    if (facing <= 0 && !ground.patch->two_sided) continue;
    const Vec3 middle = point + (facing > 0 ? skin : -skin) * normal;
    std::array<Vec3, 3> spots;
    for (std::size_t i = 0; i < spots.size(); ++i) {
      const float a = angle + 2 * std::numbers::pi_v<float> * float(i) / float(spots.size());
      spots[i] = middle + radius * (site.sigma_u * std::cos(a) * right + site.sigma_v * std::sin(a) * up);
    }
    if (sees(eyes[number], occluders, middle, spots, reach)) {
      first = number;
      return true;
    }
  }
  return false;
}

/// Is a place to be covered? Asked place by place along each row; `first` is a memory of the row's.
using WantedSite = std::function<bool(const Ground&, const Site&, Rng&, std::size_t& first)>;

std::vector<Site> sites_at_spacing(const std::vector<Ground>& grounds, float spacing, std::uint64_t seed,
                                   const WantedSite& wanted) {
  const std::vector<Row> rows = lay_rows(grounds, spacing);
  std::vector<Site> sites(rows.empty() ? 0 : rows.back().begin + rows.back().count);
  parallel_for(rows.size(), 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) {
      const Row& row = rows[r];
      const Ground& ground = grounds[row.ground];
      Rng rng(seed, r);
      std::size_t first_eye = 0;
      const float spacing_u = row.length_u.back() / float(row.count);
      for (std::uint32_t k = 0; k < row.count; ++k) {
        Site& site = sites[row.begin + k];
        site.ground = row.ground;
        const float du = rng.uniform(-jitter, jitter), dv = rng.uniform(-jitter, jitter);
        site.u = parameter_at(row.length_u, (float(k) + 0.5f + du) * spacing_u) + row.shift / float(row.count);
        site.v = row.v + dv * row.step_v;
        site.step_u = 1 / float(row.count);
        site.step_v = row.step_v;
        const bool end_u = !ground.patch->closed_u && (k == 0 || k + 1 == row.count);
        site.sigma_u = spacing_u * (end_u ? edge_overlap : overlap);
        site.sigma_v = row.spacing_v * (row.first || row.last ? edge_overlap : overlap);
        site.is_used = wanted(ground, site, rng, first_eye);
      }
    }
  });
  std::erase_if(sites, [](const Site& site) { return !site.is_used; });
  return sites;
}

struct SitesAtSpacing {
  std::vector<Site> sites;
  float spacing = 0;  ///< World units.
};

/// Sites for `count` Gaussians, by trying spacings.
///
/// At spacing s there are about a / s^2 + b / s of them: a the area that is seen, b the length of the rims around it,
/// where Gaussians that are half hidden stay. Two smaller tries tell a and b, so that the first large one mostly fits.
SitesAtSpacing sites_for_count(const std::vector<Ground>& grounds, std::size_t count, std::uint64_t seed,
                               const WantedSite& wanted_site) {
  const double tolerance = 0.008 * double(count);
  double last_density = 0, last_found = 0;           // density = 1 / spacing
  double density = 0.05 * std::sqrt(double(count));  // about a tenth of the Gaussians, if objects are of unit size
  SitesAtSpacing best, above;                        // the nearest to count; the fewest that are no fewer than count
  auto miss = [&](const SitesAtSpacing& p) { return std::abs(double(p.sites.size()) - double(count)); };
  for (int attempt = 0; attempt < 12; ++attempt) {
    const float spacing = float(1 / density);
    SitesAtSpacing tried{sites_at_spacing(grounds, spacing, seed, wanted_site), spacing};
    if (tried.sites.empty()) return tried;
    const double found = double(tried.sites.size());
    if (tried.sites.size() >= count && (above.sites.empty() || tried.sites.size() < above.sites.size())) above = tried;
    if (best.sites.empty() || miss(tried) < miss(best)) best = std::move(tried);
    if (miss(best) <= tolerance) return best;

    double rim = 0;
    if (attempt == 1)
      rim = (found / density - density * last_found / (last_density * last_density)) / (1 - density / last_density);
    rim = std::clamp(rim, 0.0, 0.5 * found / density);
    const double area = (found - rim * density) / (density * density);
    const double wanted = attempt == 0 ? 0.25 * double(count) : double(count);
    last_density = density, last_found = found;
    density = (std::sqrt(rim * rim + 4 * area * wanted) - rim) / (2 * area);
  }
  // Rows come and go with the spacing, and of a few Gaussians no spacing may give the wanted number: leave out evenly
  // what is too many.
  if (above.sites.empty()) return best;
  SitesAtSpacing thinned{{}, above.spacing};
  for (std::size_t i = 0; i < count; ++i) thinned.sites.push_back(above.sites[i * above.sites.size() / count]);
  return thinned;
}

/// Mean finish over the footprint, so that patterns finer than the Gaussians turn into their mean, not into speckle.
Finish finish_over(const Patch& patch, const Site& site) {
  Finish sum{Vec3(0.0f), 0};
  for (const float j : {-0.25f, 0.25f})
    for (const float i : {-0.25f, 0.25f}) {
      const float u = site.u + i * site.step_u, v = std::clamp(site.v + j * site.step_v, 0.0f, 1.0f);
      const Finish one = patch.material({u - std::floor(u), v, patch.position(u, v)});
      sum.albedo += 0.25f * one.albedo;
      sum.gloss += 0.25f * one.gloss;
    }
  return sum;
}

/// Colour of a Gaussian as SH of degree 1: coefficient 0 holds what its cameras see on average; bands above it make it
/// brighter towards the mirrored sun.
void paint(const Site& site, const Ground& ground, const LightMap& map, const Light& light, std::span<const Eye> eyes,
           Vec3 point, Vec3 normal, std::span<float> sh) {
  constexpr float c0 = 0.28209479177387814f, c1 = 0.4886025119029199f;  // SH constants of bands 0 and 1
  const Finish finish = finish_over(*ground.patch, site);
  const LightMap::Sample lit = map.at(site.u - std::floor(site.u), site.v);
  const float sun = lit.sun * light.through_window(point);
  const float incidence = glm::dot(normal, light.to_sun);
  // A leaf passes on about half as much light as it sends back.
  const float facing = ground.patch->two_sided ? std::max(incidence, -0.5f * incidence) : std::max(incidence, 0.0f);
  Vec3 linear = finish.albedo * (lit.ambient + sun * facing * light.sun / std::numbers::pi_v<float>);

  Vec3 to_eyes(0.0f);
  for (const Eye& eye : eyes) {
    const Vec3 to_eye = glm::normalize(eye.centre - point);
    if (glm::dot(normal, to_eye) > 0) to_eyes += to_eye;
  }
  const float eyes_length = glm::length(to_eyes);
  Vec3 tilt(0.0f);
  if (finish.gloss > 0 && eyes_length > 0) {
    to_eyes /= eyes_length;
    const Vec3 mirrored_sun = 2 * incidence * normal - light.to_sun;
    const float aligned = std::max(0.0f, glm::dot(mirrored_sun, to_eyes));
    // Schlick's approximation of how much a dielectric mirrors: 4 % head-on, all of it at grazing angles. What it
    // mirrors is taken to be as bright as its surroundings are on average.
    const float mirrored = 0.04f + 0.96f * std::pow(1 - glm::dot(normal, to_eyes), 5.0f);
    const float highlight = incidence > 0 ? sun * std::pow(aligned, 40.0f) : 0.0f;
    linear += finish.gloss * (0.35f * highlight * light.sun + 0.5f * mirrored * lit.ambient);
    const float sheen = finish.gloss * (0.03f + 0.10f * sun * aligned);
    tilt = sheen * mirrored_sun;
  }
  const Vec3 shown = develop(linear);
  for (std::size_t c = 0; c < 3; ++c) {
    float* k = sh.data() + 4 * c;
    k[0] = (shown[int(c)] - 0.5f - glm::dot(tilt, to_eyes)) / c0;
    // dot(tilt, direction to the eye) = -dot(tilt, d), with the basis c1 (-y, z, -x) of d.
    k[1] = tilt.y / c1;
    k[2] = -tilt.z / c1;
    k[3] = tilt.x / c1;
  }
}

std::vector<Eye> eyes_of(std::span<const scene::Camera> cameras) {
  std::vector<Eye> eyes;
  for (const scene::Camera& c : cameras)
    eyes.push_back({Vec3(c.centre()), Mat3(c.rotation), float(c.fx), float(c.fy), float(c.cx), float(c.cy),
                    float(c.width), float(c.height)});
  return eyes;
}

/// What casts shadows and sends light back: other objects if there are any, else those that are covered.
class Shading {
 public:
  ///   own  occluders of the objects that are covered
  Shading(std::span<const Object> covered, const Occluders& own, std::span<const Object> others)
      : objects_(others.empty() ? covered : others), own_(own) {
    if (!others.empty()) others_.emplace(others);
  }
  [[nodiscard]] std::span<const Object> objects() const { return objects_; }
  [[nodiscard]] const Occluders& occluders() const { return others_ ? *others_ : own_; }

 private:
  std::span<const Object> objects_;
  const Occluders& own_;
  std::optional<Occluders> others_;
};

/// Puts a Gaussian at every place, in the colour that it has there.
Surfels paint_sites(std::span<const Object> objects, const Light& light, std::span<const Eye> eyes,
                    const Shading& shading, const std::vector<Ground>& grounds, const std::vector<Site>& sites,
                    std::size_t count, std::uint64_t seed) {
  Surfels surfels;
  scene::GaussianCloud& cloud = surfels.cloud;
  cloud.sh_degree = 1;
  cloud.resize(sites.size());
  surfels.object.resize(sites.size());
  if (sites.empty()) return surfels;
  // Shadows need no finer grid than this to look right; few Gaussians need no finer grid than themselves.
  const float texel = std::max(0.028f, 4.0f / std::sqrt(float(count)));
  std::vector<LightMap> maps = make_light_maps(objects, texel);
  for (const Site& site : sites) maps[site.ground].want(site.u - std::floor(site.u), site.v);
  bake(objects, shading.objects(), shading.occluders(), light, maps);

  parallel_for(sites.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Site& site = sites[i];
      const Ground& ground = grounds[site.ground];
      const Vec3 point = ground.object->placement.world(ground.patch->position(site.u, site.v));
      const Vec3 normal = ground.turned.world(normal_at(*ground.patch, site.u, site.v));
      constexpr float h = 1e-3f;
      Vec3 along =
          ground.turned.world(ground.patch->position(site.u + h, site.v) - ground.patch->position(site.u - h, site.v));
      along = glm::normalize(along - glm::dot(along, normal) * normal);
      const Quat rotation = glm::quat_cast(Mat3(along, glm::cross(normal, along), normal));
      cloud.mean.set(i, point);
      cloud.rotation.set(i, rotation);
      const float thickness = 0.06f * std::min(site.sigma_u, site.sigma_v);
      cloud.log_scale.set(i, Vec3(std::log(site.sigma_u), std::log(site.sigma_v), std::log(thickness)));
      Rng rng(seed, (std::uint64_t{1} << 40) + i);  // apart from the streams of the rows
      cloud.opacity_logit[i] = rng.uniform(3.6f, 4.6f);
      paint(site, ground, maps[site.ground], light, eyes, point, normal, cloud.sh_row(i));
      surfels.object[i] = std::uint16_t(ground.object - objects.data());
    }
  });
  return surfels;
}

}  // namespace

Surfels make_surfels(std::span<const Object> objects, const Light& light, std::span<const scene::Camera> cameras,
                     std::size_t count, std::uint64_t seed, std::span<const Object> shading) {
  const std::vector<Eye> eyes = eyes_of(cameras);
  const Occluders occluders(objects);
  const std::vector<Ground> grounds = lay_ground(objects);
  const auto [sites, spacing] =
      sites_for_count(grounds, count, seed, [&](const Ground& ground, const Site& site, Rng& rng, std::size_t& first) {
        return is_seen(ground, site, eyes, occluders, rng, first);
      });
  Surfels surfels =
      paint_sites(objects, light, eyes, Shading(objects, occluders, shading), grounds, sites, count, seed);
  surfels.spacing = spacing;
  return surfels;
}

Surfels make_unseen_surfels(const Surfels& seen, std::span<const Object> objects, const Light& light,
                            std::span<const scene::Camera> cameras, std::size_t count, std::uint64_t seed,
                            std::span<const Object> shading) {
  const std::vector<Eye> eyes = eyes_of(cameras);
  const Occluders occluders(objects);
  const std::vector<Ground> grounds = lay_ground(objects);
  const auto sites = sites_at_spacing(grounds, seen.spacing, seed,
                                      [&](const Ground& ground, const Site& site, Rng& rng, std::size_t& first) {
                                        return !is_seen(ground, site, eyes, occluders, rng, first);
                                      });
  Surfels surfels =
      paint_sites(objects, light, eyes, Shading(objects, occluders, shading), grounds, sites, count, seed);
  surfels.spacing = seen.spacing;
  return surfels;
}

Surfels cover_all(std::span<const Object> objects, const Light& light, std::span<const scene::Camera> cameras,
                  float spacing, std::uint64_t seed, std::span<const Object> shading) {
  const Occluders occluders(objects);
  const std::vector<Ground> grounds = lay_ground(objects);
  const auto sites =
      sites_at_spacing(grounds, spacing, seed, [](const Ground&, const Site&, Rng&, std::size_t&) { return true; });
  return paint_sites(objects, light, eyes_of(cameras), Shading(objects, occluders, shading), grounds, sites,
                     sites.size(), seed);
}

}  // namespace engine::procedural
