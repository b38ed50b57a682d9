// Versions on disk. The checksum at the end is set right: what lies behind it is believed no more for that.
#include "engine/io/overlay_file.h"

#include <zlib.h>

#include <unistd.h>
#include <cstring>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/engine/io/samples.h"
#include "tests/fuzz/fuzz.h"

namespace {

const engine::scene::GaussianCloud& base() {
  static const auto cloud = engine::io::random_cloud(8, 1, 1);
  return cloud;
}

}  // namespace

void fuzz::run(std::span<const std::byte> bytes) {
  static engine::io::MemoryFile file;
  std::string text(text_of(bytes));
  if (text.size() > sizeof(std::uint32_t)) {
    const std::size_t end = text.size() - sizeof(std::uint32_t);
    const auto crc = std::uint32_t(crc32_z(0, reinterpret_cast<const Bytef*>(text.data()), end));
    std::memcpy(text.data() + end, &crc, sizeof crc);
  }
  file.set(text);
  const auto overlay = engine::io::read_overlay(file.path(), base(), small_limits());
  if (overlay) demand(engine::scene::validate(*overlay, base()).has_value(), "an overlay that is accepted holds");
}

std::vector<std::string> fuzz::seeds() {
  std::vector<std::string> all;
  const auto path = std::filesystem::temp_directory_path() / ("splatdrag-fuzz-overlay-" + std::to_string(::getpid()));
  auto changed = engine::scene::no_change(base());
  changed.removed = {1, 5};
  changed.changed = {2};
  const std::vector<std::uint32_t> rows{2, 3};
  changed.rows = engine::scene::gather(base(), rows);
  for (const auto& overlay : {engine::scene::no_change(base()), changed}) {
    demand(engine::io::write_overlay(path, overlay, base()).has_value(), "seeds can be written");
    std::ifstream in(path, std::ios::binary);
    all.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  std::filesystem::remove(path);
  return all;
}
