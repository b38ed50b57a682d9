// The scenes of golden/raster as clouds and cameras.
#pragma once

#include <string>
#include <vector>

#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "tests/support/data.h"
#include "tests/support/safetensors.h"

namespace support {

inline const std::vector<std::string>& raster_scenes() {
  static const std::vector<std::string> names{"a_random200", "b1_needles",     "b2_huge",     "b3_tiny",
                                              "b4_near",     "b5_opacity",     "b6_quatnorm", "b7_offset1e4",
                                              "b8_mix",      "c_two_views1000"};
  return names;
}

struct RasterGolden {
  explicit RasterGolden(const std::string& name) : file(golden_dir() / "raster" / (name + ".safetensors")) {
    const Tensor& means = file.at("in.means");
    const std::size_t n = means.shape[0];
    cloud.sh_degree = 3;
    cloud.resize(n);
    const auto& scales = file.at("in.log_scales").values;
    const auto& quats = file.at("in.quats").values;
    const auto& logits = file.at("in.opacity_logits").values;
    const auto& sh = file.at("in.sh").values;  // [N, 16, 3]
    for (std::size_t i = 0; i < n; ++i) {
      auto vec3 = [&](const std::vector<double>& v) { return engine::Vec3(v[3 * i], v[3 * i + 1], v[3 * i + 2]); };
      cloud.mean.set(i, vec3(means.values));
      cloud.log_scale.set(i, vec3(scales));
      cloud.rotation.set(i, engine::Quat(float(quats[4 * i]), float(quats[4 * i + 1]), float(quats[4 * i + 2]),
                                         float(quats[4 * i + 3])));
      cloud.opacity_logit[i] = float(logits[i]);
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t k = 0; k < 16; ++k) cloud.sh_row(i)[c * 16 + k] = float(sh[(i * 16 + k) * 3 + c]);
    }
    const auto& size = file.at("in.width_height").values;
    const auto& poses = file.at("in.viewmats").values;
    const auto& intrinsics = file.at("in.intrinsics_fx_fy_cx_cy").values;
    for (std::size_t v = 0; v < file.at("in.viewmats").shape[0]; ++v) {
      engine::scene::Camera camera;
      camera.width = int(size[0]);
      camera.height = int(size[1]);
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) camera.rotation[c][r] = poses[16 * v + std::size_t(4 * r + c)];
        camera.translation[r] = poses[16 * v + std::size_t(4 * r + 3)];
      }
      camera.fx = intrinsics[4 * v], camera.fy = intrinsics[4 * v + 1];
      camera.cx = intrinsics[4 * v + 2], camera.cy = intrinsics[4 * v + 3];
      cameras.push_back(camera);
    }
    const auto& rgb = file.at("in.background").values;
    background = engine::Vec3(rgb[0], rgb[1], rgb[2]);
  }

  TensorFile file;
  engine::scene::GaussianCloud cloud;
  std::vector<engine::scene::Camera> cameras;
  engine::Vec3 background{0};
};

}  // namespace support
