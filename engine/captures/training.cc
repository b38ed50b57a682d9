#include "engine/captures/training.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <optional>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/atomic_file.h"
#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/core/checksum.h"
#include "engine/fit/checkpoint.h"
#include "engine/fit/fitter.h"
#include "engine/fit/start.h"
#include "engine/render/forward.h"
#include "engine/scene/cloud_bytes.h"

namespace engine::captures {
namespace {

constexpr std::string_view magic = "splatdrag capture\n";
constexpr std::uint32_t format_number = 1;

/// Fits to the end.
Result<scene::GaussianCloud> fitted(const Capture& capture, const fit::FitOptions& options) {
  fit::Fitter fitter(capture.photos, fit::gaussians_at(capture.points, 0), options);
  while (!fitter.done())
    if (const auto loss = fitter.step(); !loss) return propagate(loss);
  return fit::with_sh_degree(fitter.cloud(), options.sh_degree);
}

std::string bytes_of(const scene::GaussianCloud& cloud) {
  ByteWriter out;
  scene::write_cloud(out, cloud);
  return std::move(out).take();
}

std::uint64_t checksum(std::string_view bytes) { return fnv1a(std::as_bytes(std::span(bytes))); }

/// A fit in little: the same photos, an eighth as wide, through every phase of a fit within a quarter of a second.
/// What it comes to changes with any program that renders, differentiates, steps or densifies otherwise.
Result<scene::GaussianCloud> probe(Capture capture, fit::FitOptions options) {
  for (fit::Photo& photo : capture.photos)
    for (int halving = 0; halving < 3 && std::min(photo.camera.width, photo.camera.height) >= 32; ++halving)
      photo = fit::half_size(photo);
  constexpr std::size_t points = 300;
  if (capture.points.size() > points) capture.points.resize(points);
  options.iterations = 40, options.halvings = 0, options.max_gaussians = 2 * points, options.densify.every = 8;
  return fitted(capture, options);
}

Result<void> check(const Capture& capture, const fit::FitOptions& options) {
  if (auto valid = fit::validate(options); !valid) return valid;
  if (capture.photos.empty())
    return fail(ErrorCode::unprocessable, "a scene is trained from photos, and there are none");
  if (capture.points.empty())
    return fail(ErrorCode::unprocessable,
                "a fit starts from sparse points, and there are none: the photos show nothing");
  return {};
}

std::string encode(const Trained& trained) {
  ByteWriter out;
  out.write_all(std::span(magic));
  out.write(format_number);
  out.write(trained.key);
  out.write(trained.seconds);
  scene::write_cloud(out, trained.cloud);
  out.write(fnv1a(out.bytes()));
  return std::move(out).take();
}

/// What encode() wrote of this fit; nothing for other bytes.
std::optional<Trained> decode(std::string_view bytes, std::uint64_t key) {
  constexpr std::size_t tail = sizeof(std::uint64_t);
  if (bytes.size() < magic.size() + tail || !bytes.starts_with(magic)) return std::nullopt;
  const std::string_view body = bytes.substr(0, bytes.size() - tail);
  ByteReader end(std::as_bytes(std::span(bytes.substr(body.size()))));
  if (end.read<std::uint64_t>() != checksum(body)) return std::nullopt;
  ByteReader in(std::as_bytes(std::span(body.substr(magic.size()))));
  if (in.read<std::uint32_t>() != format_number) return std::nullopt;
  Trained out{.cloud = {}, .key = in.read<std::uint64_t>(), .seconds = in.read<double>(), .was_kept = true};
  out.cloud = scene::read_cloud(in);
  // The checksum is against accidents; what is used further on is looked at all the same.
  const bool is_sound = in.ok() && in.remaining() == 0 && out.key == key && std::isfinite(out.seconds) &&
                        out.cloud.size() > 0 && !scene::first_not_finite(out.cloud);
  return is_sound ? std::optional(std::move(out)) : std::nullopt;
}

}  // namespace

fit::FitOptions training_options(int iterations) {
  fit::FitOptions options;
  options.iterations = iterations;
  options.max_gaussians = 30'000;  // as many as photos of that size can tell apart; a choice
  return options;
}

Result<std::uint64_t> key_of(const Capture& capture, const fit::FitOptions& options) {
  if (auto valid = check(capture, options); !valid) return propagate(valid);
  const auto tried = probe(capture, options);
  if (!tried) return propagate(tried);
  std::ostringstream computes;
  computes << "captures " << format_number << ' ' << render::simd_target() << ' ' << checksum(bytes_of(*tried));
  return fit::identity_of(capture.photos, fit::gaussians_at(capture.points, 0), options, computes.str());
}

Result<Trained> trained(const Capture& capture, const fit::FitOptions& options, const std::filesystem::path& folder) {
  const auto key = key_of(capture, options);
  if (!key) return propagate(key);
  std::ostringstream name;
  name << std::hex << std::setfill('0') << std::setw(16) << *key << ".trained";
  const std::filesystem::path file = folder / name.str();
  std::ifstream in(file, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (auto kept = decode(bytes, *key)) return std::move(*kept);

  const auto start = std::chrono::steady_clock::now();
  auto cloud = fitted(capture, options);
  if (!cloud) return propagate(cloud);
  Trained out{.cloud = std::move(*cloud), .key = *key, .seconds = 0, .was_kept = false};
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const std::string encoded = encode(out);
  if (auto written = write_file(file, std::as_bytes(std::span(encoded))); !written) return propagate(written);
  return out;
}

}  // namespace engine::captures
