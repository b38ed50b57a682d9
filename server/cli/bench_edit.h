// What the kinds of `splatdrag bench-edit` share: options, where results are kept, what stands at the head of a report.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/edit/request.h"
#include "engine/evaluate/trial.h"
#include "proto/params_fields.h"
#include "server/cli/bench_captures.h"
#include "server/cli/compute.h"

namespace server::cli {

struct BenchOptions {
  std::vector<std::string> cases, correctors{"scene"};
  std::string out;
  proto::Preset preset = proto::Preset::draft;
  proto::Params given;                        // over the preset
  std::string scene, dataset, request, name;  // a real capture, there and back
  CaptureOptions captures;
  std::string model_dir;  // with LPIPS, which judges the cases, and the diffusion model of `sd`
  bool small = false, whole_picture = false;
  int pictures = 1;
  ComputeOptions compute;
};

/// What is given on the command line, over the preset.
void apply(const BenchOptions& options, engine::edit::Request& request);

/// Where a result is kept.
///   scene, dataset, lpips, repainter  what stands for them, see evaluate::ResultOf
[[nodiscard]] std::filesystem::path cache_file(const BenchOptions& options, const Machine& machine,
                                               const std::string& subject, const std::string& corrector,
                                               const std::string& scene, const std::string& dataset,
                                               const engine::edit::Request& request, const std::string& lpips = {},
                                               const std::string& repainter = {});

/// Writes pictures below the output folder. `options` outlive it.
[[nodiscard]] engine::evaluate::Show picture_writer(const BenchOptions& options);

/// What stands at the head of every report.
[[nodiscard]] nlohmann::ordered_json settings(const BenchOptions& options, const Machine& machine);

}  // namespace server::cli
