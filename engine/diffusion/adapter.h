// An adapter of low rank (LoRA) on the layers of a network, which can be trained.
// Source: Hu et al. 2021, "LoRA: low-rank adaptation of large language models", eq. 3.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/diffusion/tensor.h"
#include "engine/weights/adapter_file.h"

namespace engine::diffusion {

/// Adds scale * B A x to what a layer makes of x. A copy is another handle of the same adapter.
class Adapter {
 public:
  using Layers = std::map<std::string, weights::LowRank>;  ///< By name.

  explicit Adapter(const Layers& layers);

  /// A new one, which adds nothing yet: A is normal with standard deviation 1 / r, B is zero.
  ///   network  whose layers' shapes are taken; those whose names end with one of `targets` are adapted
  ///   rank     r, 1 or more; alpha  scale is alpha / r
  ///   seed     same seed, same numbers
  [[nodiscard]] static Adapter fresh(const std::vector<weights::TensorSpec>& network,
                                     const std::vector<std::string>& targets, int rank, double alpha,
                                     std::uint64_t seed);

  [[nodiscard]] Layers layers() const;  ///< As they are now.
  [[nodiscard]] bool adapts(const std::string& layer) const;
  /// Multiplies every layer's scale.
  void scale_by(double factor);

  /// What it adds to a layer's output. Preconditions: adapts(layer).
  [[nodiscard]] Tensor of_linear(const std::string& layer, const Tensor& x) const;
  [[nodiscard]] Tensor of_convolution(const std::string& layer, const Tensor& x, int stride, int padding) const;

  /// All tensors that are trained, A and B of each layer, in the order of their names; with gradients from now on.
  void collect(std::vector<Tensor>& into) const;

 private:
  struct Pairs;
  std::shared_ptr<Pairs> pairs_;
};

}  // namespace engine::diffusion
