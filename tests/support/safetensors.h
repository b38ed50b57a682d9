// Reads reference vectors in the public safetensors format.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace support {

/// A tensor with its values widened to double (F64, F32, I64, I32, U8 are known). Row-major.
struct Tensor {
  std::vector<std::size_t> shape;
  std::vector<double> values;
  std::string dtype;

  [[nodiscard]] std::vector<float> floats() const { return {values.begin(), values.end()}; }
};

/// All tensors of a file, by name. at() names the missing one.
class TensorFile {
 public:
  explicit TensorFile(const std::filesystem::path& path);
  [[nodiscard]] const Tensor& at(const std::string& name) const;
  [[nodiscard]] bool contains(const std::string& name) const { return tensors_.contains(name); }
  [[nodiscard]] const std::map<std::string, Tensor>& all() const { return tensors_; }

 private:
  std::string path_;
  std::map<std::string, Tensor> tensors_;
};

}  // namespace support
