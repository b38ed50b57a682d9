// splatdrag bench-edit --captures: edits whose right result is known, of scenes that are trained from photographs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/captures/captured_case.h"
#include "server/cli/compute.h"
#include "server/cli/options.h"

namespace server::cli {

struct BenchOptions;

/// Options of captured cases.
struct CaptureOptions {
  bool on = false;
  std::string cache;  ///< Folder of trained scenes; empty: default_capture_cache().
  std::string page;   ///< File; empty: none is written.
  std::vector<std::string> by{"balls",   "bare",       "click", "clicks",
                              "looking", "correcting", "masks", "wide_masks"};  ///< Names of captures::known_grasps().
  int fit_iterations = 1500;
  std::uint32_t take = engine::captures::first_take;
  std::string photos;    ///< Dataset whose photos the things of the cases are drawn into; empty: cases as they are.
  int photo_side = 384;  ///< Longer side of those photos as they are used, pixels.
  engine::captures::Stand stand;
  std::vector<double> at, to;  ///< For `stand`: x, y.
};

/// Adds them.
///   returns  the one that switches captured cases on
CLI::Option* add_capture_options(CLI::App& command, CaptureOptions& options);

/// "mug, barrel, ...": names of captured cases, for people.
[[nodiscard]] std::string captured_cases();

/// splatdrag/captures below $XDG_CACHE_HOME, or below $HOME/.cache.
///   errors  invalid_argument: the environment names neither
[[nodiscard]] Result<std::filesystem::path> default_capture_cache();

/// Carries captured cases out; writes captures.json, captures.md and pictures into options.out, which exists.
///   errors  those of captures::choose_captured_cases(), train(), make_ready() and carry_out(), and of writing
[[nodiscard]] Result<void> run_captures(const BenchOptions& options, const Machine& machine, Terminal& terminal);

}  // namespace server::cli
