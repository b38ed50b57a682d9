#include "server/cli/fit_report.h"

#include <nlohmann/json.hpp>

#include "proto/json_text.h"

namespace server::cli {
namespace {

using nlohmann::ordered_json;

ordered_json encode(const engine::fit::FitQuality& near) {
  return {{"psnr_db", near.psnr_db},
          {"ssim", near.ssim},
          {"worst_psnr_db", near.worst_psnr_db},
          {"worst_view", near.worst_view}};
}

}  // namespace

std::string to_json(const FitReport& report) {
  ordered_json curve = ordered_json::array();
  for (const engine::fit::Milestone& milestone : report.history.milestones)
    curve.push_back({{"iteration", milestone.iteration},
                     {"seconds", milestone.seconds},
                     {"gaussians", milestone.gaussians},
                     {"psnr_db", milestone.psnr_db}});
  const ordered_json out{{"splatdrag", SPLATDRAG_VERSION},
                         {"threads", report.machine.threads},
                         {"simd", report.machine.simd},
                         {"options",
                          {{"iterations", report.options.iterations},
                           {"max_gaussians", report.options.max_gaussians},
                           {"sh_degree", report.options.sh_degree},
                           {"max_side", report.max_side},
                           {"hold_out", report.hold_out},
                           {"seed", report.options.seed}}},
                         {"seconds", report.history.seconds},
                         {"views", report.views},
                         {"start_gaussians", report.start_gaussians},
                         {"gaussians", report.gaussians},
                         {"training", encode(report.training)},
                         {"held_out", report.held_out ? encode(*report.held_out) : ordered_json()},
                         {"curve", std::move(curve)}};
  return proto::pretty(out) + "\n";
}

}  // namespace server::cli
