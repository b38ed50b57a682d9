#include "server/edits/admission.h"

#include <algorithm>
#include <cstdio>
#include <string>

namespace server::edits {
namespace {

using engine::ErrorCode;
using engine::fail;
using engine::params::Params;

constexpr std::size_t least_side = 16;  // of the parameter's range

std::string in_words(std::uint64_t bytes) {
  const double gib = double(bytes) / double(std::uint64_t{1} << 30);
  char text[32];
  if (gib < 1)
    std::snprintf(text, sizeof text, "%.0f MiB", 1024 * gib);
  else
    std::snprintf(text, sizeof text, gib < 100 ? "%.1f GiB" : "%.0f GiB", gib);
  return text;
}

std::uint64_t bytes_with(JobWorkload work, std::size_t views, std::size_t view_pixels) {
  work.edit.views = views;
  work.edit.view_pixels = view_pixels;
  return estimated_bytes(work);
}

/// The largest number from `least` to `most` that fits; 0 where `least` does not. The estimate grows with it.
template <class Fits>
std::size_t largest_that_fits(std::size_t least, std::size_t most, Fits fits) {
  if (most < least || !fits(least)) return 0;
  while (least < most) {
    const std::size_t middle = least + (most - least + 1) / 2;
    if (fits(middle))
      least = middle;
    else
      most = middle - 1;
  }
  return least;
}

/// What would fit if one of the two parameters were lowered and the other left as it is; 0: no value would.
struct Advice {
  std::size_t views = 0, side = 0;
};

Advice advice_for(const JobWorkload& work, const Params& params, std::span<const engine::scene::Camera> dataset,
                  std::uint64_t limit) {
  const std::size_t views = work.edit.views, pixels = work.edit.view_pixels;
  const auto fits_with_views = [&](std::size_t fewer) { return bytes_with(work, fewer, pixels) <= limit; };
  const auto fits_with_side = [&](std::size_t side) {
    return bytes_with(work, views, view_pixels_at(int(side), dataset)) <= limit;
  };
  return {largest_that_fits(1, views, fits_with_views),
          largest_that_fits(least_side, std::size_t(params.max_image_side), fits_with_side)};
}

/// Are the views further beyond what is usual than the pictures' size is?
bool views_are_the_luxury(const JobWorkload& work, const Params& params) {
  const Params usual;
  const double side = double(params.max_image_side) / double(usual.max_image_side);
  return double(work.edit.views) / double(usual.views) > side * side;
}

}  // namespace

engine::Result<void> admit(const JobWorkload& work, const Params& params,
                           std::span<const engine::scene::Camera> dataset, std::uint64_t limit) {
  const std::uint64_t needed = estimated_bytes(work);
  if (limit == 0 || needed <= limit) return {};
  const std::string found = "the edit would take about " + in_words(needed) +
                            " of memory; the limit (--edit-memory) is " + in_words(limit) + ": ";
  const Advice advice = advice_for(work, params, dataset, limit);
  const std::string fewer = "lower params.views to at most " + std::to_string(advice.views);
  const std::string smaller = "lower params.max_image_side to at most " + std::to_string(advice.side);
  const bool both = advice.views > 0 && advice.side > 0;
  if (advice.views > 0 && (!both || views_are_the_luxury(work, params)))
    return fail(ErrorCode::too_large, found + fewer + (both ? ", or " + smaller : ""), "params.views");
  if (advice.side > 0)
    return fail(ErrorCode::too_large, found + smaller + (both ? ", or " + fewer : ""), "params.max_image_side");
  if (bytes_with(work, 1, least_side * least_side) <= limit)
    return fail(ErrorCode::too_large, found + "lower params.views and params.max_image_side, neither is enough alone",
                views_are_the_luxury(work, params) ? "params.views" : "params.max_image_side");
  return fail(ErrorCode::too_large, found + "the scene is too large to be edited here, whatever the parameters are",
              "scene");
}

}  // namespace server::edits
