#include "server/edits/admission.h"

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace server::edits {
namespace {

using engine::ErrorCode;
using engine::fail;
using engine::params::Params;

constexpr std::size_t least_side = 16;  // of the parameter's range
constexpr double usual_intervals = 5;   // the paper's

std::string in_words(std::uint64_t bytes) {
  const double gib = double(bytes) / double(std::uint64_t{1} << 30);
  char text[32];
  if (gib < 1)
    std::snprintf(text, sizeof text, "%.0f MiB", 1024 * gib);
  else
    std::snprintf(text, sizeof text, gib < 100 ? "%.1f GiB" : "%.0f GiB", gib);
  return text;
}

std::string time_in_words(double seconds) {
  constexpr double minute = 60, hour = 60 * minute, day = 24 * hour;
  char text[32];
  if (seconds < 3 * minute)
    std::snprintf(text, sizeof text, "%.0f s", seconds);
  else if (seconds < 3 * hour)
    std::snprintf(text, sizeof text, "%.0f minutes", seconds / minute);
  else if (seconds < 3 * day)
    std::snprintf(text, sizeof text, "%.0f hours", seconds / hour);
  else
    std::snprintf(text, sizeof text, "%.0f days", seconds / day);
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

/// Another choice, with which an edit takes less: what of its networks it can do without.
struct Choice {
  const char* advice;
  const char* where;  ///< It is made.
  void (*make)(JobWorkload&);
};

enum class Need { time, memory };

/// The choices that an edit has, those it loses least by first. Of the time that training takes there are levers.
std::vector<Choice> choices_of(const JobWorkload& work, Need need) {
  std::vector<Choice> choices;
  if (work.models.perceptual)
    choices.push_back({"set params.perceptual to \"msssim\"", "params.perceptual", [](JobWorkload& less) {
                         add_models(less, {less.models.repainter, std::nullopt});
                       }});
  if (!work.models.repainter) return choices;
  if (need == Need::memory && (work.edit.first_tuning > 0 || work.edit.later_tuning > 0))
    choices.push_back({"set params.tuning_steps and params.tuning_steps_later to 0", "params.tuning_steps",
                       [](JobWorkload& less) { less.edit.first_tuning = less.edit.later_tuning = 0; }});
  choices.push_back({"set params.corrector to \"scene\"", "params.corrector", [](JobWorkload& less) {
                       add_models(less, {std::nullopt, less.models.perceptual});
                     }});
  return choices;
}

JobWorkload with_all(const std::vector<Choice>& choices, JobWorkload work) {
  for (const Choice& choice : choices) choice.make(work);
  return work;
}

/// The choices with which together the edit fits: the fewest first ones that do, without those of them that do nothing
/// for it. None: all together do not. They go together since memory is a largest of several: one alone may change
/// nothing.
template <class Fits>
std::vector<Choice> choices_that_do(const std::vector<Choice>& choices, const JobWorkload& work, Fits fits) {
  std::vector<Choice> made;
  for (const Choice& choice : choices) {
    made.push_back(choice);
    if (!fits(with_all(made, work))) continue;
    for (std::size_t k = made.size() - 1; k-- > 0;) {  // the last one is needed
      std::vector<Choice> fewer = made;
      fewer.erase(fewer.begin() + std::ptrdiff_t(k));
      if (fits(with_all(fewer, work))) made = std::move(fewer);
    }
    return made;
  }
  return {};
}

/// "set A, set B and set C"
std::string all_advice(const std::vector<Choice>& choices) {
  std::string text;
  for (std::size_t k = 0; k < choices.size(); ++k)
    text += (k == 0 ? "" : k + 1 < choices.size() ? ", " : " and ") + std::string(choices[k].advice);
  return text;
}

/// A parameter that an edit's time grows with.
struct Lever {
  const char* name;
  std::size_t value, least;
  double luxury;  ///< How many times what is usual it asks for.
  std::function<void(JobWorkload&, std::size_t)> set;
  std::size_t fits = 0;  ///< The largest value with which the edit would be accepted; 0: none would do alone.
};

/// The levers of an edit, the most luxurious one first. The usual values are those of `standard`.
std::vector<Lever> levers_of(const JobWorkload& work, const Params& params,
                             std::span<const engine::scene::Camera> dataset) {
  const Params usual = engine::params::filled_in({}, engine::params::Preset::standard);
  const double side = double(params.max_image_side) / double(usual.max_image_side);
  const auto count = [](int number) { return std::size_t(std::max(number, 0)); };
  std::vector<Lever> levers{
      {"iterations", count(work.edit.iterations), 1, double(work.edit.iterations) / double(usual.iterations),
       [](JobWorkload& w, std::size_t value) { w.edit.iterations = int(value); }},
      {"annealing_steps", count(work.edit.corrections), 1, double(work.edit.corrections),
       [](JobWorkload& w, std::size_t value) { w.edit.corrections = int(value); }},
      {"intervals", count(work.edit.intervals), 1, double(work.edit.intervals) / usual_intervals,
       [](JobWorkload& w, std::size_t value) { w.edit.intervals = int(value); }},
      {"views", work.edit.views, 1, double(work.edit.views) / double(usual.views),
       [](JobWorkload& w, std::size_t value) { w.edit.views = value; }},
      {"max_image_side", count(params.max_image_side), least_side, side * side,
       [dataset](JobWorkload& w, std::size_t value) { w.edit.view_pixels = view_pixels_at(int(value), dataset); }},
  };
  if (work.edit.repainted) {
    levers.push_back({"tuning_steps", count(work.edit.first_tuning), 1,
                      double(work.edit.first_tuning) / double(usual.tuning_steps),
                      [](JobWorkload& w, std::size_t value) { w.edit.first_tuning = int(value); }});
    levers.push_back({"tuning_steps_later", count(work.edit.later_tuning), 1,
                      double(work.edit.later_tuning) / double(usual.tuning_steps_later),
                      [](JobWorkload& w, std::size_t value) { w.edit.later_tuning = int(value); }});
    levers.push_back(
        {"sampling_steps", count(params.sampling_steps), 1,
         double(params.sampling_steps) / double(usual.sampling_steps),
         [of_a_step = work.edit.repaint_time.full_strength / std::max(1, params.sampling_steps)](
             JobWorkload& w, std::size_t value) { w.edit.repaint_time.full_strength = of_a_step * double(value); }});
  }
  std::ranges::stable_sort(levers, std::greater{}, &Lever::luxury);
  return levers;
}

}  // namespace

engine::Result<void> admit_time(const JobWorkload& work, const Params& params,
                                std::span<const engine::scene::Camera> dataset, double limit) {
  const double needed = estimated_seconds(work);
  if (limit <= 0 || needed <= limit) return {};
  const std::string found = "the edit would take about " + time_in_words(needed) + "; the limit (--edit-time) is " +
                            time_in_words(limit) + ": ";
  std::vector<Lever> levers = levers_of(work, params, dataset);
  std::vector<Lever> that_do;
  JobWorkload least = work;
  for (Lever& lever : levers) {
    lever.fits = largest_that_fits(lever.least, lever.value, [&](std::size_t value) {
      JobWorkload lower = work;
      lever.set(lower, value);
      return estimated_seconds(lower) <= limit;
    });
    if (lever.fits > 0) that_do.push_back(lever);
    lever.set(least, std::min(lever.least, lever.value));
  }
  const auto address = [](const Lever& lever) { return std::string("params.") + lever.name; };
  const auto advice = [&](const Lever& lever) {
    return "lower " + address(lever) + " to at most " + std::to_string(lever.fits);
  };
  const auto fits = [&](const JobWorkload& less) { return estimated_seconds(less) <= limit; };
  const std::vector<Choice> choices = choices_of(work, Need::time);
  const std::vector<Choice> that_fit = choices_that_do(choices, work, fits);
  if (!that_do.empty())
    return fail(ErrorCode::too_large,
                found + advice(that_do[0]) + (that_do.size() > 1 ? ", or " + advice(that_do[1]) : "") +
                    (that_fit.empty() ? "" : ", or " + all_advice(that_fit)),
                address(that_do[0]));
  if (!that_fit.empty()) return fail(ErrorCode::too_large, found + all_advice(that_fit), that_fit[0].where);
  if (fits(least))
    return fail(ErrorCode::too_large,
                found + "lower " + address(levers[0]) + " and " + address(levers[1]) + ", one alone is not enough",
                address(levers[0]));
  if (!choices.empty() && fits(with_all(choices, least)))
    return fail(ErrorCode::too_large,
                found + all_advice(choices) + ", and lower " + address(levers[0]) + " and " + address(levers[1]),
                choices[0].where);
  return fail(ErrorCode::too_large, found + "the scene is too large to be edited here, whatever the parameters are",
              "scene");
}

engine::Result<void> admit_slow(const JobWorkload& work, bool allowed) {
  const bool repainted = work.models.repainter.has_value(), by_lpips = work.models.perceptual.has_value();
  if (allowed || (!repainted && !by_lpips)) return {};
  const double needed = estimated_seconds(work);
  if (needed <= slow_seconds) return {};
  const std::string networks = std::string(repainted ? "the diffusion model" : "") +
                               (repainted && by_lpips ? " and " : "") +
                               (by_lpips ? "the network of the perceptual loss" : "");
  return fail(ErrorCode::unprocessable,
              "the edit, with " + networks + ", would take about " + time_in_words(needed) +
                  " on this machine: say \"allow_slow\": true to have it do so, or lower params.views, " +
                  (repainted ? "params.tuning_steps, params.sampling_steps or " : "params.max_image_side or ") +
                  "params.iterations" + (by_lpips ? ", or set params.perceptual to \"msssim\"" : ""),
              "allow_slow");
}

engine::Result<void> admit(const JobWorkload& work, const Params& params,
                           std::span<const engine::scene::Camera> dataset, std::uint64_t limit) {
  const std::uint64_t needed = estimated_bytes(work);
  if (limit == 0 || needed <= limit) return {};
  const std::string found = "the edit would take about " + in_words(needed) +
                            " of memory; the limit (--edit-memory) is " + in_words(limit) + ": ";
  const auto fits = [&](const JobWorkload& less) { return estimated_bytes(less) <= limit; };
  const auto refused = [&](const std::string& text, const char* where) {
    return fail(ErrorCode::too_large, found + text, where);
  };
  const Advice advice = advice_for(work, params, dataset, limit);
  const std::vector<Choice> choices = choices_of(work, Need::memory);
  const std::vector<Choice> that_fit = choices_that_do(choices, work, fits);
  const std::string fewer = "lower params.views to at most " + std::to_string(advice.views);
  const std::string smaller = "lower params.max_image_side to at most " + std::to_string(advice.side);
  const std::string otherwise = that_fit.empty() ? "" : ", or " + all_advice(that_fit);
  const bool both = advice.views > 0 && advice.side > 0;
  const char* const luxury = views_are_the_luxury(work, params) ? "params.views" : "params.max_image_side";
  if (advice.views > 0 && (!both || views_are_the_luxury(work, params)))
    return refused(fewer + (both ? ", or " + smaller : "") + otherwise, "params.views");
  if (advice.side > 0) return refused(smaller + (both ? ", or " + fewer : "") + otherwise, "params.max_image_side");
  if (!that_fit.empty()) return refused(all_advice(that_fit), that_fit[0].where);
  JobWorkload least = work;
  least.edit.views = 1, least.edit.view_pixels = least_side * least_side;
  if (fits(least)) return refused("lower params.views and params.max_image_side, neither is enough alone", luxury);
  if (!choices.empty() && fits(with_all(choices, least)))
    return refused(all_advice(choices) + ", and lower params.views and params.max_image_side", choices[0].where);
  return refused("the scene is too large to be edited here, whatever the parameters are", "scene");
}

}  // namespace server::edits
