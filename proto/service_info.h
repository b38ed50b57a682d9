// What GET /v1/info answers: what this service can do, and where its limits are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace proto {

/// Something that an edit request can name, and, where it cannot be had, why.
struct Capability {
  std::string name;
  bool available = true;
  std::string reason;  ///< Why it is not available; else empty.
};

/// Most of each thing that the service takes: bytes, counts, and pixels of a side.
struct ServiceLimits {
  std::uint64_t upload_bytes = 0, json_bytes = 0, gaussians = 0, handles = 0, views = 0, render_side = 0,
                image_side = 0, queued_edits = 0, scene_memory_bytes = 0, edit_memory_bytes = 0, edit_seconds = 0,
                streams = 0, scenes = 0, dataset_bytes = 0;
};

/// What the service is and has.
struct ServiceInfo {
  std::string version;                      ///< Release of the program.
  std::string simd;                         ///< Instruction set in use.
  std::vector<std::string> simd_available;  ///< Best first.
  int threads = 0;
  std::vector<std::string> devices = {"cpu"};
  std::vector<Capability> correctors, perceptual;
  std::vector<std::string> loras;  ///< Adapters that the corrector `sd` can paint with, by name.
  std::vector<std::string> read_formats, write_formats, picture_formats, presets;
  ServiceLimits limits;
  bool token_required = false;
  bool scene_root = false;  ///< Whether files on the service's machine may be opened.
};

///   session  whether this very call is authorised
[[nodiscard]] std::string to_json(const ServiceInfo& info, bool session);

}  // namespace proto
