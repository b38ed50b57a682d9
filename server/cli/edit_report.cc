#include "server/cli/edit_report.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "proto/json_text.h"

namespace server::cli {
namespace {

using nlohmann::ordered_json;

ordered_json encode(engine::DVec3 v) { return {v.x, v.y, v.z}; }

ordered_json encode(const engine::edit::HandleReport& handle) {
  ordered_json positions = ordered_json::array();
  for (const engine::DVec3 position : handle.relocated) positions.push_back(encode(position));
  return {{"gaussians", handle.gaussians}, {"positions", std::move(positions)}};
}

ordered_json encode(const engine::edit::Uncovered& uncovered) {
  ordered_json out{{"view", uncovered.view}, {"area", uncovered.area}, {"open", uncovered.open}, {"open_box", nullptr}};
  if (uncovered.open > 0)
    out["open_box"] = {uncovered.open_from.x, uncovered.open_from.y, uncovered.open_to.x, uncovered.open_to.y};
  return out;
}

ordered_json encode(const ViewPictures& pictures) {
  ordered_json out{{"view", pictures.view},
                   {"before", pictures.before},
                   {"after", pictures.after},
                   {"mask", pictures.mask},
                   {"psnr_outside_mask_db", nullptr}};
  if (std::isfinite(pictures.psnr_outside_db)) out["psnr_outside_mask_db"] = pictures.psnr_outside_db;
  return out;
}

template <class Items, class Encode>
ordered_json list_of(const Items& items, Encode encode_item) {
  ordered_json list = ordered_json::array();
  for (const auto& item : items) list.push_back(encode_item(item));
  return list;
}

}  // namespace

std::string to_json(const EditReport& report) {
  const engine::edit::Report& edit = report.edit;
  const ordered_json out{
      {"splatdrag", SPLATDRAG_VERSION},
      {"simd", report.machine.simd},
      {"threads", report.machine.threads},
      {"scene", report.scene_file},
      {"request", ordered_json::parse(proto::to_json(report.request))},
      {"gaussians",
       {{"input", edit.input_gaussians},
        {"output", edit.output_gaussians},
        {"removed", edit.removed},
        {"copies", edit.copies},
        {"changeable", edit.changeable},
        {"crumbs", edit.crumbs},
        {"relit", edit.relit}}},
      {"handles", list_of(edit.handles, [](const auto& handle) { return encode(handle); })},
      {"parts", list_of(edit.parts,
                        [](const auto& part) {
                          return ordered_json{{"group", part.group},
                                              {"how", engine::name_of(part.how)},
                                              {"why", part.why},
                                              {"settled", part.settled}};
                        })},
      {"views", list_of(edit.views,
                        [](const auto& view) {
                          return ordered_json{{"name", view.name}, {"mask_area", view.mask_area}};
                        })},
      {"uncovered", list_of(edit.uncovered, [](const auto& view) { return encode(view); })},
      {"losses", edit.losses},
      {"pictures", list_of(report.pictures, [](const auto& pictures) { return encode(pictures); })},
      {"seconds", report.seconds},
      {"stages", list_of(edit.times,
                         [](const auto& time) {
                           return ordered_json{{"stage", engine::edit::name_of(time.stage)}, {"seconds", time.seconds}};
                         })},
      {"warnings", edit.warnings}};
  return proto::pretty(out) + "\n";
}

}  // namespace server::cli
