// Reference vectors as libtorch's tensors, and how near a tensor comes to one.
#pragma once

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/empty.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "engine/diffusion/layers.h"
#include "engine/weights/checkpoint.h"
#include "tests/support/data.h"
#include "tests/support/safetensors.h"

namespace engine::diffusion {

inline Tensor as_tensor(const support::Tensor& values) {
  const std::vector<std::int64_t> shape(values.shape.begin(), values.shape.end());
  const bool whole = values.dtype == "I64";
  Tensor tensor = at::empty(shape, whole ? at::kLong : at::kFloat);
  if (whole)
    std::transform(values.values.begin(), values.values.end(), tensor.data_ptr<std::int64_t>(),
                   [](double value) { return std::int64_t(value); });
  else
    std::transform(values.values.begin(), values.values.end(), tensor.data_ptr<float>(),
                   [](double value) { return float(value); });
  return tensor;
}

inline double largest(const Tensor& tensor) { return tensor.abs().max().item<double>(); }

/// Is every number within `tolerance` of the reference?
inline testing::AssertionResult near(const Tensor& tensor, const Tensor& reference, double tolerance) {
  if (!tensor.defined() || tensor.sizes() != reference.sizes())
    return testing::AssertionFailure() << "a shape of its own";
  const double difference = largest(tensor.detach() - reference);
  if (difference <= tolerance) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "differs by " << difference << ", more than " << tolerance
                                     << "; the reference is up to " << largest(reference);
}

/// |tensor - reference| / |reference|, as vectors.
inline double relative_distance(const Tensor& tensor, const Tensor& reference) {
  return ((tensor.detach() - reference).norm() / reference.norm()).item<double>();
}

/// The tiny checkpoint of the reference.
struct TinyModels {
  weights::Checkpoint checkpoint;
  Model unet, autoencoder, text_encoder;

  [[nodiscard]] const weights::Configs& configs() const { return checkpoint.configs(); }
};

inline TinyModels tiny_models() {
  TinyModels models{weights::Checkpoint::open(support::golden_dir() / "tiny_sd").value(), {}, {}, {}};
  models.unet.parameters = Parameters::load(models.checkpoint, weights::Network::unet).value();
  models.autoencoder.parameters = Parameters::load(models.checkpoint, weights::Network::autoencoder).value();
  models.text_encoder.parameters = Parameters::load(models.checkpoint, weights::Network::text_encoder).value();
  return models;
}

}  // namespace engine::diffusion
