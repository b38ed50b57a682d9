// The parameters of an edit: the one place that names them. Each is a field of ParametersOf and, below it, an entry of
// the table. From the table come: the range check, JSON both ways, checkpoints, what presets fill in, the options of
// bench-edit, the list in `splatdrag edit --help` and in GET /v1/info (and so the fields of the page). A test holds
// proto/openapi.yaml against it.
//
// A new parameter takes: a field, an entry, its lines in proto/openapi.yaml, and the code that reads it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "engine/core/result.h"
#include "engine/deform/intervals.h"
#include "engine/params/choices.h"
#include "engine/params/parameter.h"

namespace engine::params {

constexpr int max_views = 1000;                   ///< End of a range, like the next two. A choice: far beyond use.
constexpr std::size_t max_excluded_views = 1000;  ///< A choice.
constexpr int max_image_side = 16384;             ///< Pixels; what a camera may have.

/// A field per parameter, each in a slot: the value itself, or perhaps one. What they mean stands in the table.
template <template <class> class Slot>
struct ParametersOf {
  Slot<int> intervals{};
  Slot<int> annealing_steps{};
  Slot<double> strength_initial{};
  Slot<double> strength_final{};
  Slot<Annealing> annealing{};
  Slot<int> iterations{};
  Slot<int> views{};
  Slot<std::vector<std::string>> exclude_views{};
  Slot<int> max_image_side{};
  Slot<Corrector> corrector{};
  Slot<Perceptual> perceptual{};
  Slot<Rotation> rotation{};
  Slot<Interpolation> interpolation{};
  Slot<bool> rotate_sh{};
  Slot<Background> background{};
  Slot<std::uint64_t> seed{};
  Slot<double> guidance{};
  Slot<Sampler> sampler{};
  Slot<int> sampling_steps{};
  Slot<int> lora_rank{};
  Slot<int> tuning_steps{};
  Slot<int> tuning_steps_later{};
  Slot<bool> local_mask{};
  Slot<bool> optimise_unmoved{};
  bool operator==(const ParametersOf&) const = default;
};

template <class T>
using Itself = T;
using Values = ParametersOf<Itself>;

/// What somebody gave; the rest is left to the preset.
using GivenParams = ParametersOf<std::optional>;

/// An entry of the table.
template <class T>
struct Parameter {
  std::string_view name;  ///< On the wire: the field's own.
  T Values::*value;
  std::optional<T> GivenParams::*given;
  Part part;
  Range<T> range{};
  Defaults<T> defaults{};
  std::string_view unit{};   ///< Of the number; empty: none.
  std::string_view noun{};   ///< What a message about the range calls it.
  std::string_view meaning;  ///< A sentence; proto/openapi.yaml may go on from there.
  bool on_wire = true;       ///< False: for measurements and tests, out of reach of a request.
};

/// In the order in which JSON lists them, those that are on the wire first.
#define SPLATDRAG_FIELD(field) .name = #field, .value = &Values::field, .given = &GivenParams::field
constexpr std::tuple table{
    Parameter{SPLATDRAG_FIELD(intervals), .part = Part::motion,
              .range = {1, deform::max_intervals, "choose it from the drag"},
              .defaults = {.usual = 0, .paper = 5},  // preset_intervals() knows better, once there is a drag
              .noun = "the number of intervals", .meaning = "T, the steps in which the drag is taken."},
    Parameter{SPLATDRAG_FIELD(annealing_steps), .part = Part::optimisation, .range = {1, 100},
              .defaults = {.usual = 1, .paper = 4}, .noun = "the number of corrections per interval",
              .meaning = "A, corrections per interval."},
    Parameter{SPLATDRAG_FIELD(strength_initial), .part = Part::correction, .range = {0, 1}, .defaults = {.usual = 0.5},
              .noun = "a strength", .meaning = "Strength of the first correction of an interval."},
    Parameter{SPLATDRAG_FIELD(strength_final), .part = Part::correction, .range = {0, 1}, .defaults = {.usual = 0.3},
              .noun = "a strength", .meaning = "Strength of the last correction of an interval."},
    Parameter{SPLATDRAG_FIELD(annealing), .part = Part::correction, .defaults = {.usual = Annealing::linear},
              .meaning = "How the strength falls: `linear` reaches the final one, `paper` stops one step short of it, "
                         "as printed."},
    Parameter{SPLATDRAG_FIELD(iterations), .part = Part::optimisation, .range = {0, 1'000'000},
              .defaults = {.usual = 0, .draft = 200, .standard = 500, .paper = 500},
              .noun = "the number of iterations per correction",
              .meaning = "Of the optimisation after each correction; 0 neither corrects nor optimises."},
    Parameter{SPLATDRAG_FIELD(views), .part = Part::views, .range = {1, max_views},
              .defaults = {.usual = 50, .draft = 24}, .noun = "the number of views",
              .meaning = "Most views an edit looks through."},
    Parameter{SPLATDRAG_FIELD(exclude_views), .part = Part::views, .range = {max_excluded_views},
              .meaning = "Names of views to leave out."},
    Parameter{SPLATDRAG_FIELD(max_image_side), .part = Part::views, .range = {16, max_image_side},
              .defaults = {.usual = 512, .draft = 384}, .unit = "pixels",
              .noun = "the longer side of a working picture",
              .meaning = "Longer side of the pictures an edit works on."},
    Parameter{SPLATDRAG_FIELD(corrector), .part = Part::correction,
              .defaults = {.usual = Corrector::none,
                           .draft = Corrector::scene,
                           .standard = Corrector::scene,
                           .paper = Corrector::scene},
              .meaning = "What repairs the pictures that the optimisation is to reach: `scene` fills them from the "
                         "scene's own pictures, `none` leaves them as they are, `sd` is a diffusion model."},
    Parameter{SPLATDRAG_FIELD(perceptual), .part = Part::optimisation, .defaults = {.usual = Perceptual::msssim},
              .meaning = "The loss that compares pictures as people do."},
    Parameter{SPLATDRAG_FIELD(rotation), .part = Part::motion, .defaults = {.usual = Rotation::shortest_arc},
              .meaning = "How handles turn what is around them: `shortest_arc` by the least rotation, `paper` as "
                         "printed, which is twice as far, `none` not at all."},
    Parameter{SPLATDRAG_FIELD(interpolation), .part = Part::motion,
              .defaults = {.usual = Interpolation::paper,
                           .preview = Interpolation::rigid,
                           .draft = Interpolation::rigid,
                           .standard = Interpolation::rigid},
              .meaning = "How a Gaussian follows the handles near it: `paper` as printed, `smooth` without jumps, "
                         "`rigid` so that what moves as one piece stays one, `arap` as an elastic body, as rigid as "
                         "possible."},
    Parameter{SPLATDRAG_FIELD(rotate_sh), .part = Part::motion, .defaults = {.usual = true},
              .meaning = "Colours that depend on direction turn with their Gaussian."},
    Parameter{SPLATDRAG_FIELD(background), .part = Part::optimisation, .defaults = {.usual = Background::render},
              .meaning = "What pixels outside of the masks are held to: `render`, as the scene looked, or `photo`."},
    Parameter{SPLATDRAG_FIELD(seed), .part = Part::optimisation, .meaning = "Of everything that is left to chance."},
    Parameter{SPLATDRAG_FIELD(guidance), .part = Part::diffusion, .range = {1, 100}, .defaults = {.usual = 7.5},
              .noun = "the guidance",
              .meaning = "How much more the prompt counts than the lack of it; 1 halves the time."},
    Parameter{SPLATDRAG_FIELD(sampler), .part = Part::diffusion, .defaults = {.usual = Sampler::dpmpp2m},
              .meaning =
                  "How noise becomes a picture: `ddim`, `pndm`, `dpmpp2m` in 20 to 50 steps, `lcm` in 2 to 8 with "
                  "networks that were distilled to it."},
    Parameter{SPLATDRAG_FIELD(sampling_steps), .part = Part::diffusion, .range = {1, 500}, .defaults = {.usual = 20},
              .noun = "the number of steps of a sampler",
              .meaning = "Steps of the sampler at strength 1; less strength takes as many fewer."},
    Parameter{SPLATDRAG_FIELD(lora_rank), .part = Part::diffusion, .range = {1, 256}, .defaults = {.usual = 4},
              .noun = "the rank of the adapter", .meaning = "Rank of the adapter (LoRA) that is trained on the scene."},
    Parameter{SPLATDRAG_FIELD(tuning_steps), .part = Part::diffusion, .range = {0, 100'000}, .defaults = {.usual = 200},
              .noun = "the number of steps of training",
              .meaning = "Steps of fine-tuning on the scene's pictures before the first interval."},
    Parameter{SPLATDRAG_FIELD(tuning_steps_later), .part = Part::diffusion, .range = {0, 100'000},
              .defaults = {.usual = 50}, .noun = "the number of steps of training",
              .meaning = "Steps of fine-tuning before each later interval, on what earlier ones have made as well."},
    Parameter{SPLATDRAG_FIELD(local_mask), .part = Part::optimisation, .defaults = {.usual = true},
              .meaning = "False: the whole picture counts as edited, to measure what the mask is worth.",
              .on_wire = false},
    Parameter{SPLATDRAG_FIELD(optimise_unmoved), .part = Part::optimisation,
              .meaning = "For tests: masks and optimises also what no handle moves.", .on_wire = false},
};
#undef SPLATDRAG_FIELD

constexpr std::size_t parameter_count = std::tuple_size_v<decltype(table)>;

/// Calls visit(const Parameter<T>&) for each entry, in order.
template <class Visit>
constexpr void for_each_parameter(Visit&& visit) {
  std::apply([&](const auto&... parameter) { (visit(parameter), ...); }, table);
}

/// Names of the parameters that a request may give.
constexpr std::size_t wire_count = [] {
  std::size_t count = 0;
  for_each_parameter([&](const auto& parameter) { count += parameter.on_wire; });
  return count;
}();
constexpr auto wire_names = [] {
  std::array<std::string_view, wire_count> all;
  std::size_t count = 0;
  for_each_parameter([&](const auto& parameter) {
    if (parameter.on_wire) all[count++] = parameter.name;
  });
  return all;
}();

namespace detail {

template <class>
using OneByte = char;

/// Is there an entry for every field, and no second one?
constexpr bool lists_every_field() {
  std::array<std::string_view, parameter_count> seen;
  std::size_t count = 0;
  bool twice = false;
  for_each_parameter([&](const auto& parameter) {
    for (std::size_t i = 0; i < count; ++i) twice = twice || seen[i] == parameter.name;
    seen[count++] = parameter.name;
  });
  return count == sizeof(ParametersOf<OneByte>) && !twice;
}
static_assert(lists_every_field(), "each field of ParametersOf has one entry in the table");

}  // namespace detail

/// The parameters of an edit.
struct Params : Values {
  Params();  ///< Each as it usually is, whatever presets say.
};

/// A preset, with what was given in place of its own.
[[nodiscard]] Params filled_in(const GivenParams& given, Preset preset);

/// All of these that a request may give, as if it had.
[[nodiscard]] GivenParams as_given(const Values& values);

/// What a drag is to a preset's choice of intervals.
struct DragKind {
  bool extends = false;    ///< Mode::extend
  bool one_piece = false;  ///< One interval carries every group to its place exactly.
  bool selected = false;   ///< A selection says what moves.
  bool turns = false;      ///< Handles turn or scale by themselves, or the part is held or free: what only a body does.
};

/// The intervals of a preset; 0: from the length of the drag. One of two defaults that the table cannot
/// state.
[[nodiscard]] int preset_intervals(Preset preset, const DragKind& drag);

/// The interpolation of a preset: what is selected is a thing, and moves as an elastic body.
[[nodiscard]] Interpolation preset_interpolation(Preset preset, const DragKind& drag);

/// Ranges of all parameters.
///   errors  invalid_argument: `where` is the address, such as "params.views"
[[nodiscard]] Result<void> validate(const Values& values);

}  // namespace engine::params
