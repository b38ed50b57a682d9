// What can be chosen about an edit from a few words. Each enumeration exists once, with the names it has on the wire.
#pragma once

#include <array>

#include "engine/core/names.h"
#include "engine/deform/choices.h"

namespace engine::params {

using deform::Attach;
using deform::Interpolation;
using deform::Rotation;

enum class Mode {
  move,    ///< The dragged part leaves its place.
  extend,  ///< It is drawn out: the original and the trail stay.
  remove   ///< It leaves its place and arrives nowhere.
};
constexpr auto names_of(Mode) {
  return std::array{Name{Mode::move, "move"}, Name{Mode::extend, "extend"}, Name{Mode::remove, "remove"}};
}

/// What becomes of crumbs: of what a selection has left out of the part that it means.
enum class Crumbs {
  move,    ///< They go along.
  remove,  ///< They go away.
  keep     ///< They stay, as all that is not selected.
};
constexpr auto names_of(Crumbs) {
  return std::array{Name{Crumbs::move, "move"}, Name{Crumbs::remove, "remove"}, Name{Crumbs::keep, "keep"}};
}

/// What becomes of the shadow of a part, where it leaves what it stands on or next to.
enum class ShadowOfPart {
  move,    ///< It goes along, as far as the part stays on the same surface.
  remove,  ///< It goes away.
  keep     ///< It stays, as all that is not selected.
};
constexpr auto names_of(ShadowOfPart) {
  return std::array{Name{ShadowOfPart::move, "move"}, Name{ShadowOfPart::remove, "remove"},
                    Name{ShadowOfPart::keep, "keep"}};
}

/// Where a part arrives that stands on something.
enum class Settle {
  automatic,  ///< Where its handles miss a surface by little, on that.
  off         ///< Where its handles ask.
};
constexpr auto names_of(Settle) { return std::array{Name{Settle::automatic, "auto"}, Name{Settle::off, "off"}}; }

/// A name for a set of parameters. How their numbers were found: docs/tradeoff.md.
enum class Preset {
  preview,   ///< Only deforms.
  draft,     ///< Corrects and optimises, soon.
  standard,  ///< The same, well.
  paper,     ///< With the numbers of the paper.
};
constexpr auto names_of(Preset) {
  return std::array{Name{Preset::preview, "preview"}, Name{Preset::draft, "draft"}, Name{Preset::standard, "standard"},
                    Name{Preset::paper, "paper"}};
}

/// How the strength of a correction falls from the first of an interval to the last, number A.
enum class Annealing {
  linear,  ///< It reaches the final value: S_init - (a - 1) / (A - 1) (S_init - S_final).
  paper,   ///< As printed: (a - 1) / A in its place, so that the final value is never reached.
};
constexpr auto names_of(Annealing) {
  return std::array{Name{Annealing::linear, "linear"}, Name{Annealing::paper, "paper"}};
}

/// What repairs the pictures that the optimisation is to reach.
enum class Corrector {
  none,
  scene,  ///< Patches of the scene's own pictures.
  sd,     ///< A diffusion model.
};
constexpr auto names_of(Corrector) {
  return std::array{Name{Corrector::none, "none"}, Name{Corrector::scene, "scene"}, Name{Corrector::sd, "sd"}};
}

/// How the diffusion model gets from noise to a picture.
enum class Sampler {
  ddim,
  pndm,     ///< As Stable Diffusion 1.x was published with.
  dpmpp2m,  ///< DPM-Solver++ of second order.
  lcm       ///< Consistency, in 2 to 8 steps: for networks that were distilled to it.
};
constexpr auto names_of(Sampler) {
  return std::array{Name{Sampler::ddim, "ddim"}, Name{Sampler::pndm, "pndm"}, Name{Sampler::dpmpp2m, "dpmpp2m"},
                    Name{Sampler::lcm, "lcm"}};
}

/// The loss that compares pictures as people do.
enum class Perceptual { msssim, lpips };
constexpr auto names_of(Perceptual) {
  return std::array{Name{Perceptual::msssim, "msssim"}, Name{Perceptual::lpips, "lpips"}};
}

/// What pixels outside of the masks are held to.
enum class Background {
  render,  ///< What the scene looked like there.
  photo,   ///< The photos of the dataset.
};
constexpr auto names_of(Background) {
  return std::array{Name{Background::render, "render"}, Name{Background::photo, "photo"}};
}

}  // namespace engine::params
