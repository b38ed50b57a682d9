#include "tests/support/safetensors.h"

#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tests/support/data.h"

namespace support {
namespace {

template <class T>
std::vector<double> widened(const char* bytes, std::size_t size) {
  std::vector<T> values(size / sizeof(T));
  std::memcpy(values.data(), bytes, values.size() * sizeof(T));
  return {values.begin(), values.end()};
}

std::vector<double> decoded(const std::string& dtype, const char* bytes, std::size_t size) {
  if (dtype == "F64") return widened<double>(bytes, size);
  if (dtype == "F32") return widened<float>(bytes, size);
  if (dtype == "I64") return widened<std::int64_t>(bytes, size);
  if (dtype == "I32") return widened<std::int32_t>(bytes, size);
  if (dtype == "U8") return widened<std::uint8_t>(bytes, size);
  throw std::runtime_error("unknown dtype " + dtype);
}

}  // namespace

TensorFile::TensorFile(const std::filesystem::path& path) : path_(path.string()) {
  const std::string bytes = read_file(path);
  std::uint64_t header_size = 0;
  std::memcpy(&header_size, bytes.data(), sizeof header_size);
  const auto header = nlohmann::json::parse(bytes.substr(8, header_size));
  for (const auto& [name, entry] : header.items()) {
    if (name == "__metadata__") continue;
    const std::size_t begin = entry["data_offsets"][0], end = entry["data_offsets"][1];
    Tensor tensor;
    tensor.dtype = entry["dtype"];
    tensor.shape = entry["shape"].get<std::vector<std::size_t>>();
    tensor.values = decoded(tensor.dtype, bytes.data() + 8 + header_size + begin, end - begin);
    tensors_.emplace(name, std::move(tensor));
  }
}

const Tensor& TensorFile::at(const std::string& name) const {
  const auto found = tensors_.find(name);
  if (found == tensors_.end()) throw std::runtime_error(path_ + " has no tensor " + name);
  return found->second;
}

}  // namespace support
