#include "engine/diffusion/training.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/full.h>
#include <ATen/ops/randn.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "engine/diffusion/adapter.h"
#include "engine/diffusion/guard.h"
#include "tests/engine/diffusion/tiny_folder.h"

namespace engine::diffusion {
namespace {

/// A tiny UNet with an adapter, and something to learn from.
struct Student {
  TinyFolder folder;
  weights::Checkpoint checkpoint = weights::Checkpoint::open(folder.path()).value();
  Adapter adapter = Adapter::fresh(weights::tensors_of(checkpoint.configs().unet), {"to_q", "to_k", "to_v", "to_out.0"},
                                   2, 2, /*seed=*/1);
  std::vector<Tensor> trained;
  Tensor latents = at::randn({2, 4, 8, 8}), noise = at::randn({2, 4, 8, 8}), timesteps = at::full({2}, 300, at::kLong);
  Tensor context = at::randn({2, 77, 6});
  Model unet{.parameters = Parameters::load(checkpoint, weights::Network::unet).value(), .adapters = {adapter}};

  Student() {
    adapter.collect(trained);
    for (Tensor& tensor : trained) tensor.set_data(at::randn(tensor.sizes()) * 0.1);  // B is not zero
  }
  /// Of each tensor that is trained, and last of the context.
  Result<std::vector<Tensor>> gradients() {
    for (Tensor& tensor : trained) tensor.mutable_grad().reset();
    Tensor asked = context.detach().clone().requires_grad_();
    const auto loss = add_gradient(unet, checkpoint.configs(), {&latents, &noise, &timesteps, &asked}, 1);
    if (!loss) return propagate(loss);
    std::vector<Tensor> all;
    for (const Tensor& tensor : trained) all.push_back(tensor.grad().clone());
    all.push_back(asked.grad().clone());
    return all;
  }
};

TEST(Training, ComputingTransformersAgainGivesTheSameGradients) {
  Student student;
  int blocks = 0;
  student.unet.before_block = [&] { ++blocks; };
  student.unet.recomputes = false;
  const auto kept = student.gradients();
  ASSERT_TRUE(kept) << kept.error().message;
  const int once = blocks;
  student.unet.recomputes = true;
  const auto again = student.gradients();
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(blocks, 2 * once + 4 + 1 + 6) << "each transformer once more";
  ASSERT_EQ(kept->size(), 11u * 8 * 2 + 1);
  for (std::size_t i = 0; i < kept->size(); ++i) {
    const double difference = ((*kept)[i] - (*again)[i]).norm().item<double>();
    EXPECT_GT((*kept)[i].norm().item<double>(), 0) << i;
    EXPECT_LE(difference, 1e-6 * (*kept)[i].norm().item<double>()) << i;
  }
}

TEST(Training, EndsAtAnyBlockOnTheWayThereAndBack) {
  Student student;
  int blocks = 0;
  student.unet.before_block = [&] { ++blocks; };
  ASSERT_TRUE(student.gradients());
  for (int last = 1; last <= blocks; ++last) {
    int left = last;
    student.unet.before_block = [&] {
      if (--left == 0) throw Ended({ErrorCode::cancelled, "enough", "here"});
    };
    const auto ended = student.gradients();
    ASSERT_FALSE(ended) << last;
    EXPECT_EQ(ended.error().code, ErrorCode::cancelled);
    EXPECT_EQ(ended.error().where, "here");
    EXPECT_EQ(left, 0) << "nothing is computed after it";
  }
}

}  // namespace
}  // namespace engine::diffusion
