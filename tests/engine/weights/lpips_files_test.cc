#include "engine/weights/lpips_files.h"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "tests/support/data.h"

namespace engine::weights {
namespace {

/// A tensor as a file has it.
struct Written {
  TensorSpec spec;
  std::string dtype = "F16";
};
std::uint64_t bytes_of(const Written& tensor) {
  std::uint64_t bytes = tensor.dtype == "I64" || tensor.dtype == "F64" ? 8 : tensor.dtype == "U8" ? 1 : 2;
  for (const std::int64_t size : tensor.spec.shape) bytes *= std::uint64_t(size);
  return bytes;
}

/// A file of zeros.
std::vector<std::byte> file_of(const std::vector<Written>& tensors) {
  std::string header = "{";
  std::uint64_t offset = 0;
  for (const Written& tensor : tensors) {
    header += (offset > 0 ? ",\"" : "\"") + tensor.spec.name + "\":{\"dtype\":\"" + tensor.dtype +
              "\",\"shape\":" + text_of(tensor.spec.shape) + ",\"data_offsets\":[" + std::to_string(offset) + "," +
              std::to_string(offset + bytes_of(tensor)) + "]}";
    offset += bytes_of(tensor);
  }
  header += "}";
  const std::uint64_t size = header.size();
  std::vector<std::byte> bytes(sizeof size + header.size() + offset);
  std::memcpy(bytes.data(), &size, sizeof size);
  std::memcpy(bytes.data() + sizeof size, header.data(), header.size());
  return bytes;
}

std::vector<Written> vgg16() {
  std::vector<Written> tensors;
  for (const VggConvolution& convolution : vgg_convolutions) {
    tensors.push_back({vgg_weight(convolution)});
    tensors.push_back({vgg_bias(convolution)});
  }
  tensors.push_back({{"classifier.6.bias", {1000}}});
  return tensors;
}
std::vector<Written> linear() {
  std::vector<Written> tensors;
  for (const VggConvolution& convolution : vgg_convolutions)
    if (convolution.ends_depth) tensors.push_back({lpips_weight(tensors.size(), convolution.out)});
  return tensors;
}

LpipsFiles parsed(std::vector<std::byte> network, std::vector<std::byte> own) {
  return {TensorFile::parse(std::move(network), "vgg16").value(), TensorFile::parse(std::move(own), "linear").value()};
}

TEST(LpipsFiles, AreTakenIfEveryTensorIsThere) {
  const auto checked = parsed(file_of(vgg16()), file_of(linear())).check();
  EXPECT_TRUE(checked) << checked.error().message;
}

TEST(LpipsFiles, WhatIsWrongWithATensorIsNamed) {
  const auto error_of = [](const std::function<void(std::vector<Written>&)>& change, bool of_network) {
    std::vector<Written> network = vgg16(), own = linear();
    change(of_network ? network : own);
    const auto checked = parsed(file_of(network), file_of(own)).check();
    return checked ? Error{ErrorCode::internal, "accepted", ""} : checked.error();
  };
  const auto missing = error_of([](auto& tensors) { tensors.erase(tensors.begin() + 3); }, true);
  EXPECT_EQ(missing.where, "vgg16:features.2.bias");
  EXPECT_EQ(missing.code, ErrorCode::corrupt_data);
  const auto shape = error_of([](auto& tensors) { tensors[2].spec.shape = {64, 64, 9}; }, true);
  EXPECT_EQ(shape.where, "vgg16:features.2.weight");
  EXPECT_NE(shape.message.find("[64, 64, 3, 3]"), std::string::npos) << shape.message;
  EXPECT_EQ(error_of(
                [](auto& tensors) {
                  tensors[4].spec.shape = {1, 511, 1, 1};
                },
                false)
                .where,
            "linear:lin4.model.1.weight");
  for (const char* type : {"I64", "F64", "U8", "BOOL9"}) {
    const auto found = error_of([&](auto& tensors) { tensors[1].dtype = type; }, false);
    EXPECT_EQ(found.where, "linear:lin1.model.1.weight") << type;
    EXPECT_EQ(found.code, ErrorCode::unsupported) << type;
    EXPECT_NE(found.message.find(type), std::string::npos) << found.message;
  }
}

TEST(LpipsFiles, CutShortAreNoFilesOfTensors) {
  const std::vector<std::byte> whole = file_of(linear());
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto cut = TensorFile::parse({whole.begin(), whole.begin() + std::ptrdiff_t(size)}, "linear");
    ASSERT_FALSE(cut) << size;
    EXPECT_TRUE(cut.error().where.starts_with("linear:")) << size << ": " << cut.error().where;
  }
  const support::TempDir folder;
  support::write_file(folder.path() / "vgg.safetensors", "no file of tensors at all");
  support::write_file(folder.path() / "lin.safetensors", "");
  EXPECT_FALSE(LpipsFiles::open(folder.path() / "vgg.safetensors", folder.path() / "lin.safetensors"));
  EXPECT_EQ(LpipsFiles::open(folder.path() / "none", folder.path() / "none").error().code, ErrorCode::not_found);
}

TEST(LpipsFiles, TheirDigestIsOfWhatIsUsedOfThem) {
  const auto digest_with = [](const std::string& tensor, const std::vector<Written>& network) {
    std::vector<std::byte> bytes = file_of(network);
    std::uint64_t header = 0, at = 0;
    std::memcpy(&header, bytes.data(), sizeof header);
    at = sizeof header + header;
    for (const Written& one : network) {
      if (one.spec.name == tensor) bytes[at] = std::byte{1};
      at += bytes_of(one);
    }
    return parsed(std::move(bytes), file_of(linear())).digest();
  };
  const std::string usual = digest_with("", vgg16());
  EXPECT_EQ(usual.size(), 16u);
  EXPECT_EQ(digest_with("", vgg16()), usual);
  EXPECT_EQ(digest_with("classifier.6.bias", vgg16()), usual) << "nobody looks at it";
  EXPECT_NE(digest_with("features.28.bias", vgg16()), usual);
  std::vector<Written> other_type = vgg16();
  other_type[1].dtype = "BF16";
  EXPECT_NE(digest_with("", other_type), usual) << "the same bytes are other numbers";
}

}  // namespace
}  // namespace engine::weights
