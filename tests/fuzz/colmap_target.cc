// The first byte says which of the three files, and whether binary or text.
#include "engine/io/colmap.h"

#include "engine/core/byte_writer.h"
#include "tests/fuzz/fuzz.h"

namespace {

const engine::io::ColmapCameras& cameras() {
  static const engine::io::ColmapCameras known = [] {
    const std::string text = "1 PINHOLE 100 80 90 90 50 40\n";
    return *engine::io::parse_colmap_cameras(std::as_bytes(std::span(text)), engine::io::ColmapEncoding::text,
                                             "cameras.txt");
  }();
  return known;
}

}  // namespace

void fuzz::run(std::span<const std::byte> bytes) {
  if (bytes.empty()) return;
  const auto kind = std::to_integer<unsigned>(bytes[0]);
  const auto encoding = kind & 1 ? engine::io::ColmapEncoding::text : engine::io::ColmapEncoding::binary;
  const auto rest = bytes.subspan(1);
  if (kind / 2 % 3 == 0) (void)engine::io::parse_colmap_cameras(rest, encoding, "cameras");
  if (kind / 2 % 3 == 1) (void)engine::io::parse_colmap_images(rest, encoding, "images", cameras());
  if (kind / 2 % 3 == 2) (void)engine::io::parse_colmap_points(rest, encoding, "points3D");
}

std::vector<std::string> fuzz::seeds() {
  engine::ByteWriter camera, image, point;
  camera.write(std::uint8_t{0}), camera.write(std::uint64_t{1});
  camera.write(std::uint32_t{1}), camera.write(std::int32_t{1}), camera.write(std::uint64_t{100}),
      camera.write(std::uint64_t{80});
  for (const double p : {90.0, 90.0, 50.0, 40.0}) camera.write(p);
  image.write(std::uint8_t{2}), image.write(std::uint64_t{1}), image.write(std::uint32_t{1});
  for (const double p : {1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}) image.write(p);
  image.write(std::uint32_t{1}), image.write_all(std::span("a.jpg", 6)), image.write(std::uint64_t{0});
  point.write(std::uint8_t{4}), point.write(std::uint64_t{1}), point.write(std::uint64_t{1});
  for (const double p : {1.0, 2.0, 3.0}) point.write(p);
  for (const std::uint8_t c : {1, 2, 3}) point.write(c);
  point.write(0.5), point.write(std::uint64_t{0});
  return {std::move(camera).take(),
          std::move(image).take(),
          std::move(point).take(),
          "\x01# a comment\n1 OPENCV 100 80 90 90 50 40 0.1 0 0 0\n",
          "\x03"
          "1 1 0 0 0 0 0 1 1 a.jpg\n\n",
          "\x05"
          "1 1 2 3 10 20 30 0.5\n"};
}
