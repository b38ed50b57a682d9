#include "proto/service_info.h"

#include <nlohmann/json.hpp>

#include "proto/params_fields.h"

namespace proto {
namespace {

using nlohmann::ordered_json;

ordered_json list(const std::vector<Capability>& capabilities) {
  ordered_json array = ordered_json::array();
  for (const Capability& one : capabilities)
    array.push_back({{"name", one.name},
                     {"available", one.available},
                     {"reason", one.available ? ordered_json(nullptr) : ordered_json(one.reason)}});
  return array;
}

ordered_json object(const ServiceLimits& limits) {
  return {{"upload_bytes", limits.upload_bytes},
          {"json_bytes", limits.json_bytes},
          {"gaussians", limits.gaussians},
          {"handles", limits.handles},
          {"views", limits.views},
          {"render_side", limits.render_side},
          {"image_side", limits.image_side},
          {"queued_edits", limits.queued_edits},
          {"scene_memory_bytes", limits.scene_memory_bytes},
          {"edit_memory_bytes", limits.edit_memory_bytes},
          {"edit_seconds", limits.edit_seconds},
          {"streams", limits.streams},
          {"scenes", limits.scenes},
          {"dataset_bytes", limits.dataset_bytes}};
}

}  // namespace

std::string to_json(const ServiceInfo& info, bool session) {
  const ordered_json json{
      {"version", info.version},
      {"simd", {{"target", info.simd}, {"available", info.simd_available}}},
      {"threads", info.threads},
      {"devices", info.devices},
      {"correctors", list(info.correctors)},
      {"perceptual", list(info.perceptual)},
      {"loras", info.loras},
      {"formats", {{"read", info.read_formats}, {"write", info.write_formats}, {"pictures", info.picture_formats}}},
      {"presets", info.presets},
      {"parameters", describe_parameters()},
      {"limits", object(info.limits)},
      {"token_required", info.token_required},
      {"session", session},
      {"scene_root", info.scene_root}};
  return json.dump();
}

}  // namespace proto
