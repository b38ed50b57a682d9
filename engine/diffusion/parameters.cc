#include "engine/diffusion/parameters.h"

#include <ATen/core/Tensor.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/from_blob.h>

#include <cassert>
#include <unordered_map>
#include <utility>

#include "engine/diffusion/guard.h"

namespace engine::diffusion {
namespace {

Result<Tensor> tensor_of(const weights::FoundTensor& found) {
  const auto in_place = weights::floats_in_place(found.tensor, found.where);
  if (!in_place) return propagate(in_place);
  if (!in_place->empty()) {
    // libtorch has no tensors of constants. Nothing here writes to a network's own tensors: the file is mapped read
    // only.
    auto* const numbers = const_cast<float*>(in_place->data());
    return at::from_blob(
        numbers, found.tensor.shape, [owner = found.owner](void*) {}, at::kFloat);
  }
  Tensor tensor = at::empty(found.tensor.shape, at::kFloat);
  const std::span<float> into(tensor.data_ptr<float>(), std::size_t(tensor.numel()));
  if (const auto read = weights::read_floats(found.tensor, found.where, into); !read) return propagate(read);
  return tensor;
}

}  // namespace

struct Parameters::Tensors {
  std::unordered_map<std::string, Tensor> by_name;
};

Result<Parameters> Parameters::load(const weights::Checkpoint& checkpoint, weights::Network network) {
  return guarded("model", [&]() -> Result<Parameters> {
    auto tensors = std::make_shared<Tensors>();
    for (const weights::TensorSpec& spec : weights::tensors_of(checkpoint.configs(), network)) {
      const auto found = checkpoint.find(network, spec);
      if (!found) return propagate(found);
      auto tensor = tensor_of(*found);
      if (!tensor) return propagate(tensor);
      tensors->by_name.emplace(spec.name, std::move(*tensor));
    }
    Parameters parameters;
    parameters.tensors_ = std::move(tensors);
    return parameters;
  });
}

Parameters::Parameters(const std::map<std::string, Tensor>& tensors) {
  auto kept = std::make_shared<Tensors>();
  kept->by_name.insert(tensors.begin(), tensors.end());
  tensors_ = std::move(kept);
}

const Tensor& Parameters::at(const std::string& name) const {
  assert(contains(name));
  return tensors_->by_name.at(name);
}

bool Parameters::contains(const std::string& name) const { return tensors_->by_name.contains(name); }

}  // namespace engine::diffusion
