#include "engine/io/zip_archive.h"
#include "tests/fuzz/fuzz.h"

void fuzz::run(std::span<const std::byte> bytes) {
  const auto archive = engine::io::ZipArchive::open(bytes, "a.zip", 100);
  if (!archive) return;
  for (const auto& [name, index] : archive->names()) {
    const auto file = archive->read(name, 1 << 20, small_limits().memory);
    if (file) demand(file->bytes.size() <= 1 << 20, "no more than is asked for");
  }
}

std::vector<std::string> fuzz::seeds() {
  const std::vector<engine::io::NamedFile> files{{"a.txt", std::vector<std::byte>(10)}, {"b/c.txt", {}}};
  return {text_of(*engine::io::make_zip(files)),
          std::string("PK\5\6") + std::string(18, '\0')};  // with files, and without
}
