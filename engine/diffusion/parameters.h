// The tensors of a network, in memory.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "engine/core/result.h"
#include "engine/diffusion/tensor.h"
#include "engine/weights/checkpoint.h"

namespace engine::diffusion {

/// All tensors of one network by their names, float32, never changed: shared between jobs. A copy is another handle of
/// the same tensors. Those that lie in their file as float32 are used where they lie, and cost no memory of their own.
class Parameters {
 public:
  Parameters() = default;  ///< Without tensors.
  /// errors  those of Checkpoint::find(); corrupt_data: a NaN or infinity, by its place; too_large
  [[nodiscard]] static Result<Parameters> load(const weights::Checkpoint& checkpoint, weights::Network network);

  /// Tensors that are in memory, and are trained: they change as their owner steps.
  explicit Parameters(const std::map<std::string, Tensor>& tensors);

  /// Precondition: the network has a tensor of that name.
  [[nodiscard]] const Tensor& at(const std::string& name) const;
  [[nodiscard]] bool contains(const std::string& name) const;

 private:
  struct Tensors;
  std::shared_ptr<const Tensors> tensors_;
};

}  // namespace engine::diffusion
