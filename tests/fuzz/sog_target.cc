// Files of a scene, packed here: within a zip file, hardly a change would pass the checksum.
#include "engine/io/sog.h"

#include <algorithm>
#include <array>

#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/io/zip_archive.h"
#include "tests/fuzz/scene_target.h"

namespace {

constexpr std::array names = {"meta.json",  "lod-meta.json", "means_l.webp",       "means_u.webp",    "scales.webp",
                              "quats.webp", "sh0.webp",      "shN_centroids.webp", "shN_labels.webp", "0/meta.json"};

}  // namespace

void fuzz::run(std::span<const std::byte> bytes) {
  engine::ByteReader in(bytes);
  std::vector<engine::io::NamedFile> files;
  while (in.remaining() > 5 && files.size() < 16) {
    const std::size_t name = in.read<std::uint8_t>() % names.size();
    const auto size = std::min<std::size_t>(in.read<std::uint32_t>(), in.remaining());
    const auto content = in.take(size);
    files.push_back({names[name], {content.begin(), content.end()}});
  }
  const auto zip = engine::io::make_zip(files);
  if (!zip) return;  // two files of one name
  (void)engine::io::expected_sog_bytes(*zip);
  const auto scene = engine::io::decode_sog(*zip, "a.sog", small_limits());
  if (!scene) return;
  demand(!engine::scene::first_not_finite(scene->cloud), "a scene that is accepted is finite");
  const auto again = engine::io::encode_sog(scene->cloud, scene->origin.antialiased, "a.sog");
  demand(again && engine::io::decode_sog(*again, "a.sog", small_limits()), "what is written can be read");
}

std::vector<std::string> fuzz::seeds() {
  std::vector<std::string> all;
  for (const int degree : {0, 1}) {
    const auto zip = *engine::io::encode_sog(engine::io::random_cloud(5, degree, 1), true, "");
    const auto archive = engine::io::ZipArchive::open(zip, "");
    engine::ByteWriter out;
    for (std::size_t k = 0; k < names.size(); ++k) {
      const auto file = archive->read(names[k], 1 << 20, nullptr);
      if (!file) continue;
      out.write(std::uint8_t(k)), out.write(std::uint32_t(file->bytes.size())), out.write_all(std::span(file->bytes));
    }
    all.push_back(std::move(out).take());
  }
  const std::string streamed =
      R"({"lodLevels":2,"filenames":["0/meta.json"],"tree":{"children":[{"lods":{"0":{"file":0,"offset":0,"count":5}}}]}})";
  engine::ByteWriter out;
  out.write(std::uint8_t{1}), out.write(std::uint32_t(streamed.size())), out.write_all(std::span(streamed));
  all.push_back(std::move(out).take() + all.front());
  return all;
}
