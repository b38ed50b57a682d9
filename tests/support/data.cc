#include "tests/support/data.h"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace support {
namespace {

std::filesystem::path from_env(const char* variable, const char* below_shared) {
  if (const char* value = std::getenv(variable)) return value;
  return std::filesystem::path(SPLATDRAG_SOURCE_DIR) / ".." / "shared" / below_shared;
}

}  // namespace

std::filesystem::path source_dir() { return SPLATDRAG_SOURCE_DIR; }
std::filesystem::path golden_dir() { return from_env("SPLATDRAG_GOLDEN", "golden"); }
std::filesystem::path data_dir() { return from_env("SPLATDRAG_DATA", "data"); }

TempDir::TempDir() {
  std::string pattern = (std::filesystem::temp_directory_path() / "splatdrag-test-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make " + pattern);
  path_ = pattern;
}

TempDir::~TempDir() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot read " + path.string());
  std::ostringstream bytes;
  bytes << file.rdbuf();
  return bytes.str();
}

void write_file(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), std::streamsize(bytes.size()));
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace support
