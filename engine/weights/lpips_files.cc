#include "engine/weights/lpips_files.h"

#include <utility>

#include "engine/weights/digest.h"

namespace engine::weights {
namespace {

/// Calls look(file, tensor) for each tensor of the two, until it returns an error.
template <class Look>
Result<void> for_each_tensor(const LpipsFiles& files, Look&& look) {
  std::size_t depth = 0;
  for (const VggConvolution& convolution : vgg_convolutions) {
    for (const TensorSpec& spec : {vgg_weight(convolution), vgg_bias(convolution)})
      if (Result<void> done = look(files.vgg16, spec); !done) return done;
    if (!convolution.ends_depth) continue;
    if (Result<void> done = look(files.linear, lpips_weight(depth++, convolution.out)); !done) return done;
  }
  return {};
}

Result<void> check_tensor(const TensorFile& file, const TensorSpec& spec) {
  const std::string where = file.name() + ":" + spec.name;
  const StoredTensor* const stored = file.find(spec.name);
  if (stored == nullptr) return fail(ErrorCode::corrupt_data, "this tensor is missing", where);
  if (stored->shape != spec.shape)
    return fail(ErrorCode::corrupt_data, "its shape is " + text_of(stored->shape) + "; expected " + text_of(spec.shape),
                where);
  if (!stored->has_floats())
    return fail(ErrorCode::unsupported, "its numbers are " + stored->dtype + "; F16, BF16 and F32 are read", where);
  return {};
}

}  // namespace

TensorSpec vgg_weight(const VggConvolution& convolution) {
  return {"features." + std::to_string(convolution.place) + ".weight", {convolution.out, convolution.in, 3, 3}};
}
TensorSpec vgg_bias(const VggConvolution& convolution) {
  return {"features." + std::to_string(convolution.place) + ".bias", {convolution.out}};
}
TensorSpec lpips_weight(std::size_t depth, int channels) {
  return {"lin" + std::to_string(depth) + ".model.1.weight", {1, channels, 1, 1}};
}

Result<LpipsFiles> LpipsFiles::open(const std::filesystem::path& vgg16, const std::filesystem::path& linear) {
  auto network = TensorFile::open(vgg16);
  if (!network) return propagate(network);
  auto own = TensorFile::open(linear);
  if (!own) return propagate(own);
  LpipsFiles files{std::move(*network), std::move(*own)};
  if (const auto checked = files.check(); !checked) return propagate(checked);
  return files;
}

Result<void> LpipsFiles::check() const { return for_each_tensor(*this, check_tensor); }

std::string LpipsFiles::digest() const {
  Digest digest;
  (void)for_each_tensor(*this, [&](const TensorFile& file, const TensorSpec& spec) -> Result<void> {
    digest.add(spec.name, *file.find(spec.name));
    return {};
  });
  return digest.text();
}

}  // namespace engine::weights
