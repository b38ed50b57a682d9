// Versions 1 to 3 are packed here: within gzip, hardly a change would pass the checksum.
#include "engine/io/spz.h"

#include "engine/io/gzip.h"
#include "tests/fuzz/scene_target.h"

namespace {

void decode(std::span<const std::byte> bytes) {
  const auto scene = engine::io::decode_spz(bytes, "a.spz", fuzz::small_limits());
  if (!scene) return;
  fuzz::demand(!engine::scene::first_not_finite(scene->cloud), "a scene that is accepted is finite");
  const auto again = engine::io::encode_spz(scene->cloud, "a.spz",
                                            {.version = scene->origin.version == 4 ? 4 : 3,
                                             .axes = scene->origin.axes,
                                             .extensions = scene->origin.spz_extensions});
  fuzz::demand(again.has_value(), "a scene that is accepted can be written");
  const auto back = engine::io::decode_spz(*again, "a.spz", fuzz::small_limits());
  fuzz::demand(back && back->cloud.size() == scene->cloud.size(), "what is written can be read");
  fuzz::demand(back->origin.spz_extensions == scene->origin.spz_extensions, "extensions are kept");
}

}  // namespace

void fuzz::run(std::span<const std::byte> bytes) {
  (void)engine::io::expected_spz_bytes(bytes, bytes.size());
  decode(bytes);
  if (bytes.size() > 16) decode(engine::io::gzip(bytes));
}

std::vector<std::string> fuzz::seeds() {
  std::vector<std::string> all;
  const std::vector<engine::io::SpzExtension> extensions{{0x12340001, std::vector<std::byte>(5)}};
  for (const int degree : {0, 1}) {
    const auto cloud = engine::io::random_cloud(2, degree, 1);
    all.push_back(text_of(*engine::io::encode_spz(cloud, "", {.version = 4, .extensions = extensions})));
    const auto packed = *engine::io::encode_spz(cloud, "", {.version = 3, .axes = "RFU", .extensions = extensions});
    engine::io::GzipReader in(packed);
    std::vector<std::byte> unpacked(4096);
    unpacked.resize(in.read_some(unpacked));
    all.push_back(text_of(unpacked));
  }
  return all;
}
