#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "engine/optim/losses.h"
#include "engine/optim/losses_reference.h"
#include "tests/engine/optim/pictures.h"
#include "tests/support/data.h"
#include "tests/support/safetensors.h"

namespace engine::optim {
namespace {

scene::Image picture(const support::Tensor& tensor) {
  scene::Image image(int(tensor.shape[2]), int(tensor.shape[1]), int(tensor.shape[0]));
  image.data = tensor.floats();
  return image;
}

scene::Mask mask_of(const support::Tensor& tensor) {
  scene::Mask mask(int(tensor.shape[1]), int(tensor.shape[0]));
  for (std::size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = tensor.values[i] != 0 ? 1 : 0;
  return mask;
}

struct Case {
  std::string name;
  bool masked;
  double ssim;  ///< ssim.json, ssim_f64.
};

class SsimGolden : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    REQUIRE_SHARED(support::golden_dir() / "ssim.safetensors");
    const support::TensorFile file(support::golden_dir() / "ssim.safetensors");
    x = picture(file.at(GetParam().name + ".img1"));
    y = picture(file.at(GetParam().name + ".img2"));
    if (GetParam().masked) mask = mask_of(file.at("mask"));
    const std::string prefix = GetParam().name + (GetParam().masked ? ".mask" : ".nomask");
    map = file.at(prefix + ".map").values;
    v_x = file.at(prefix + ".grad_img1").values;
    v_y = file.at(prefix + ".grad_img2").values;
  }

  scene::Image x, y;
  scene::Mask mask;
  std::vector<double> map, v_x, v_y;
};
INSTANTIATE_TEST_SUITE_P(
    Cases, SsimGolden,
    testing::Values(Case{"a_random", false, 0.09295464272584238}, Case{"a_random", true, 0.30830162695059143},
                    Case{"b_noisy", false, 0.7601754254296641}, Case{"b_noisy", true, 0.8264973178744746},
                    Case{"c_close_dark", false, 0.996160616932785}, Case{"c_close_dark", true, 0.9970843372316036}),
    [](const auto& each) { return each.param.name + (each.param.masked ? "_masked" : ""); });

TEST_P(SsimGolden, TheReferenceGivesValueMapAndGradient) {
  double loss = 0;
  std::vector<double> seen_map, seen_v;
  for (int c = 0; c < 3; ++c) {
    const auto pass =
        reference::ssim_pass<double>(plane_of<double>(x, c), plane_of<double>(y, c), mask.data, SsimTerm::full);
    loss += pass.sum / double(x.data.size());
    seen_map.insert(seen_map.end(), pass.map.data.begin(), pass.map.data.end());
    for (const double v : pass.v_x.data) seen_v.push_back(-v / double(x.data.size()));
  }
  EXPECT_NEAR(1 - loss, GetParam().ssim, 1e-6);
  for (std::size_t i = 0; i < map.size(); ++i) ASSERT_NEAR(seen_map[i], map[i], 1e-6) << "value " << i;
  EXPECT_LT(relative_error(seen_v, v_x), 1e-6);
}

TEST_P(SsimGolden, TheVectorKernelGivesValueAndBothGradients) {
  LossWorkspace workspace;
  const MaskView masked = mask.data.empty() ? MaskView{} : view(mask);
  for (const bool swapped : {false, true}) {
    const scene::Image &rendered = swapped ? y : x, &target = swapped ? x : y;
    scene::Image v(x.width, x.height, 3);
    const double loss = ssim_loss(view(rendered), view(target), masked, x.pixels(), -1, workspace, view(v));
    EXPECT_NEAR(1 - loss, GetParam().ssim, 5e-6);
    EXPECT_LT(relative_error(v.data, swapped ? v_y : v_x), 1e-4);
  }
}

}  // namespace
}  // namespace engine::optim
