#include "engine/fit/checkpoint.h"

#include <cstddef>
#include <cstring>

#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/core/checksum.h"
#include "engine/scene/cloud_bytes.h"

namespace engine::fit {
namespace {

constexpr std::string_view magic = "splatdrag fit\n";
constexpr std::uint32_t format_number = 1;  // of the bytes that encode() makes

void write(ByteWriter& out, const scene::Camera& camera) {
  out.write_string(camera.name);
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) out.write(camera.rotation[column][row]);
  for (int axis = 0; axis < 3; ++axis) out.write(camera.translation[axis]);
  for (const double number : {camera.fx, camera.fy, camera.cx, camera.cy}) out.write(number);
  out.write(std::int32_t(camera.width));
  out.write(std::int32_t(camera.height));
}

void write(ByteWriter& out, const FitOptions& options) {
  out.write(std::int32_t(options.iterations));
  out.write(std::int32_t(options.sh_degree));
  out.write(std::uint64_t(options.max_gaussians));
  out.write(std::int32_t(options.halvings));
  out.write(options.seed);
  for (int c = 0; c < 3; ++c) out.write(options.background[c]);
  const optim::LearningRates& rates = options.rates;
  for (const double number :
       {rates.position, rates.sh_dc, rates.sh_rest, rates.opacity_logit, rates.log_scale, rates.rotation, rates.last,
        options.adam.beta1, options.adam.beta2, options.adam.epsilon, options.loss.l1_weight, options.loss.ssim_weight,
        options.loss.l1.scale, options.densify.until, options.densify.gradient, options.densify.dense,
        options.least_opacity})
    out.write(number);
  out.write(std::int32_t(options.loss.l1.kind));
  out.write(std::int32_t(options.densify.every));
}

}  // namespace

std::uint64_t identity_of(std::span<const Photo> photos, const scene::GaussianCloud& start, const FitOptions& options,
                          std::string_view computes) {
  ByteWriter all;
  all.write_string(computes);
  write(all, options);
  scene::write_cloud(all, start);
  for (const Photo& photo : photos) {
    write(all, photo.camera);
    all.write(fnv1a(std::as_bytes(std::span(photo.rgb))));
  }
  return fnv1a(all.bytes());
}

std::string encode(std::uint64_t identity, const History& history, const Fitter& fitter) {
  ByteWriter out;
  out.write_all(std::span(magic));
  out.write(format_number);
  out.write(identity);
  out.write(history.seconds);
  out.write(std::uint32_t(history.milestones.size()));
  for (const Milestone& milestone : history.milestones) {
    out.write(std::int32_t(milestone.iteration));
    out.write(milestone.seconds);
    out.write(milestone.gaussians);
    out.write(milestone.psnr_db);
  }
  fitter.write(out);
  out.write(fnv1a(out.bytes()));
  return std::move(out).take();
}

Result<History> decode(std::string_view text, std::uint64_t identity, Fitter& fitter) {
  const auto wrong = [](ErrorCode code, const char* what) { return fail(code, what, "checkpoint"); };
  const std::span<const std::byte> bytes = std::as_bytes(std::span(text));
  if (!text.starts_with(magic)) return wrong(ErrorCode::corrupt_data, "This is no checkpoint of a fit.");
  std::uint64_t checksum = 0;
  if (bytes.size() < magic.size() + sizeof(checksum)) return wrong(ErrorCode::corrupt_data, "The checkpoint is cut.");
  const std::size_t contents = bytes.size() - sizeof(checksum);
  std::memcpy(&checksum, bytes.data() + contents, sizeof(checksum));
  ByteReader in(bytes.subspan(magic.size(), contents - magic.size()));
  if (in.read<std::uint32_t>() != format_number)
    return wrong(ErrorCode::unsupported, "The checkpoint is that of another version of this program.");
  if (checksum != fnv1a(bytes.first(contents))) return wrong(ErrorCode::corrupt_data, "The checkpoint is damaged.");
  if (in.read<std::uint64_t>() != identity)
    return wrong(ErrorCode::conflict,
                 "The checkpoint is that of a fit with other photos, another start, other options, or on another kind "
                 "of machine.");
  History history{in.read<double>(), {}};
  const auto count = in.read<std::uint32_t>();
  for (std::uint32_t i = 0; i < count && in.ok(); ++i) {
    Milestone& milestone = history.milestones.emplace_back();
    milestone.iteration = in.read<std::int32_t>();
    milestone.seconds = in.read<double>();
    milestone.gaussians = in.read<std::uint64_t>();
    milestone.psnr_db = in.read<double>();
  }
  fitter.read(in);
  if (!in.ok() || in.remaining() != 0) return wrong(ErrorCode::corrupt_data, "The checkpoint is damaged.");
  return history;
}

}  // namespace engine::fit
