// A fit under way, as bytes: what it takes to go on after an interruption.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/fit/fitter.h"
#include "engine/fit/options.h"
#include "engine/fit/photo.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::fit {

/// How far a fit had come at some time.
struct Milestone {
  int iteration = 0;   ///< Iterations done.
  double seconds = 0;  ///< Time of work, without interruptions.
  std::uint64_t gaussians = 0;
  double psnr_db = 0;  ///< Mean over training views, or over some of them that are evenly spread.
  bool operator==(const Milestone&) const = default;
};

/// The course of a fit so far.
struct History {
  double seconds = 0;  ///< Time of work so far, without interruptions.
  std::vector<Milestone> milestones;
  bool operator==(const History&) const = default;
};

/// A number that another fit hardly has: one with other photos, another start or other options.
///   computes  what else bytes depend on: the program's release, the instruction set
[[nodiscard]] std::uint64_t identity_of(std::span<const Photo> photos, const scene::GaussianCloud& start,
                                        const FitOptions& options, std::string_view computes);

/// The bytes of a checkpoint: magic, format number, contents, checksum.
[[nodiscard]] std::string encode(std::uint64_t identity, const History& history, const Fitter& fitter);

/// Puts the bytes that encode() made into a fitter that has just been made.
///   errors  corrupt_data; unsupported: another format number; conflict: another identity. `where` is
///           "checkpoint". The fitter must not be used then.
[[nodiscard]] Result<History> decode(std::string_view bytes, std::uint64_t identity, Fitter& fitter);

}  // namespace engine::fit
