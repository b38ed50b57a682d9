// Where the files of LPIPS lie below the model folder. For this room alone.
#pragma once

#include <filesystem>

#include "engine/core/result.h"
#include "engine/weights/lpips_files.h"

namespace server::models {

constexpr const char *vgg16_file = "vgg16.safetensors", *lpips_file = "vgg_v0.1.safetensors";

/// errors  those of LpipsFiles::open()
inline engine::Result<engine::weights::LpipsFiles> open_lpips(const std::filesystem::path& model_folder) {
  const std::filesystem::path folder = model_folder / "lpips";
  return engine::weights::LpipsFiles::open(folder / vgg16_file, folder / lpips_file);
}

}  // namespace server::models
