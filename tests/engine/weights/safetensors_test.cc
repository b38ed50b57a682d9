#include "engine/weights/safetensors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/engine/weights/samples.h"
#include "tests/support/data.h"

namespace engine::weights {
namespace {

std::string where_of(const std::string& header, const std::string& data = std::string(8, '\0')) {
  const auto file = TensorFile::parse(file_of(header, data), "a.safetensors");
  return file ? "accepted" : file.error().where;
}

std::vector<float> floats(const StoredTensor& tensor) {
  std::vector<float> values(tensor.elements());
  EXPECT_TRUE(read_floats(tensor, "", values));
  return values;
}

TEST(Safetensors, WhatIsWrittenIsRead) {
  const std::map<std::string, FloatTensor> tensors = {
      {"b", {{2, 3}, {1, 2, 3, 4, 5, 6}}}, {"a", {{}, {-0.5f}}}, {"none", {{0, 4}, {}}}};
  support::TempDir folder;
  support::write_file(folder.path() / "a.safetensors", encode_tensors(tensors, {{"format", "pt"}}));
  const auto file = TensorFile::open(folder.path() / "a.safetensors");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->metadata().at("format"), "pt");
  ASSERT_EQ(file->tensors().size(), 3u);
  for (const auto& [name, tensor] : tensors) {
    ASSERT_NE(file->find(name), nullptr) << name;
    EXPECT_EQ(file->find(name)->shape, tensor.shape);
    EXPECT_EQ(floats(*file->find(name)), tensor.values);
  }
  EXPECT_EQ(file->find("c"), nullptr);
}

TEST(Safetensors, HalvesOfBothKindsAreWidenedExactly) {
  // 1, -2, 65504, the least number above zero, the least normal one, -0, and 1/3 as it is rounded.
  const std::string halves("\x00\x3c\x00\xc0\xff\x7b\x01\x00\x00\x04\x00\x80\x55\x35", 14);
  const std::string bfloats("\x80\x3f\x00\xc0", 4);
  const auto file = TensorFile::parse(
      file_of(
          R"({"h":{"dtype":"F16","shape":[7],"data_offsets":[0,14]},"b":{"dtype":"BF16","shape":[2],"data_offsets":[14,18]}})",
          halves + bfloats),
      "a");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(floats(*file->find("h")), (std::vector<float>{1, -2, 65504, 0x1p-24f, 0x1p-14f, -0.0f, 0.333251953125f}));
  EXPECT_TRUE(std::signbit(floats(*file->find("h"))[5]));
  EXPECT_EQ(floats(*file->find("b")), (std::vector<float>{1, -2}));
}

TEST(Safetensors, ANumberThatIsNoneIsNamedByItsPlace) {
  const std::string infinite_half("\x00\x3c\x00\x7c", 4);
  const auto half =
      TensorFile::parse(file_of(R"({"h":{"dtype":"F16","shape":[2],"data_offsets":[0,4]}})", infinite_half), "a");
  std::vector<float> values(2);
  auto read = read_floats(*half->find("h"), "a:h", values);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().where, "a:h[1]");
  const FloatTensor poisoned{{3}, {0, 1, std::numeric_limits<float>::quiet_NaN()}};
  const auto file = TensorFile::parse(bytes_of(encode_tensors({{"x", poisoned}})), "a");
  values.resize(3);
  read = read_floats(*file->find("x"), "a:x", values);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(read.error().where, "a:x[2]");
  EXPECT_EQ(floats_in_place(*file->find("x"), "a:x").error().where, "a:x[2]");
}

TEST(Safetensors, FloatsAreFoundWhereTheyLie) {
  const std::string entries =
      R"("x":{"dtype":"F32","shape":[2],"data_offsets":[0,8]},"h":{"dtype":"F16","shape":[1],"data_offsets":[8,10]})";
  const std::string data("\x00\x00\x80\x3f\x00\x00\x00\xc0\x00\x3c", 10);
  const auto aligned =
      TensorFile::parse(file_of("{" + std::string((8 - (entries.size() + 2) % 8) % 8, ' ') + entries + "}", data), "a");
  ASSERT_TRUE(aligned) << aligned.error().message;
  const auto found = floats_in_place(*aligned->find("x"), "a:x");
  ASSERT_TRUE(found);
  EXPECT_EQ(static_cast<const void*>(found->data()), aligned->find("x")->bytes.data());
  EXPECT_EQ(std::vector<float>(found->begin(), found->end()), (std::vector<float>{1, -2}));
  EXPECT_TRUE(floats_in_place(*aligned->find("h"), "a:h")->empty()) << "a half is no float";
  const auto crooked =
      TensorFile::parse(file_of("{" + std::string((9 - (entries.size() + 2) % 8) % 8, ' ') + entries + "}", data), "a");
  EXPECT_TRUE(floats_in_place(*crooked->find("x"), "a:x")->empty()) << "no float lies at an odd address";
  EXPECT_EQ(floats(*crooked->find("x")), (std::vector<float>{1, -2})) << "but it is read";
}

TEST(Safetensors, OtherTypesAreListedAndNotReadAsNumbers) {
  const auto file = TensorFile::parse(
      file_of(
          R"({"i":{"dtype":"I64","shape":[1],"data_offsets":[0,8]},"q":{"dtype":"Q3","shape":[5],"data_offsets":[8,9]}})",
          std::string(9, '\0')),
      "a");
  ASSERT_TRUE(file) << file.error().message;
  std::vector<float> values(1);
  const auto read = read_floats(*file->find("i"), "a:i", values);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::unsupported);
  values.resize(5);
  EXPECT_FALSE(read_floats(*file->find("q"), "a:q", values));
}

TEST(Safetensors, WhatContradictsItselfIsNamedByItsTensor) {
  const auto entry = [](const std::string& name, const std::string& shape, int begin, int end) {
    return "\"" + name + R"(":{"dtype":"F32","shape":)" + shape + ",\"data_offsets\":[" + std::to_string(begin) + "," +
           std::to_string(end) + "]}";
  };
  EXPECT_EQ(where_of("{" + entry("x", "[2]", 0, 8) + "}"), "accepted");
  EXPECT_EQ(where_of("{" + entry("x", "[3]", 0, 8) + "}"), "a.safetensors:x") << "a shape of other bytes";
  EXPECT_EQ(where_of("{" + entry("x", "[3]", 0, 12) + "}"), "a.safetensors:x") << "beyond the end";
  EXPECT_EQ(where_of("{" + entry("x", "[1]", 8, 4) + "}"), "a.safetensors:x") << "backwards";
  EXPECT_EQ(where_of("{" + entry("x", "[2]", 0, 8) + "," + entry("y", "[1]", 4, 8) + "}"), "a.safetensors:y");
  EXPECT_EQ(where_of("{" + entry("x", "[1]", 4, 8) + "}"), "a.safetensors:x") << "a hole before it";
  EXPECT_EQ(where_of("{" + entry("x", "[1]", 0, 4) + "}"), "a.safetensors:header") << "bytes of nobody at the end";
  EXPECT_EQ(where_of("{" + entry("x", "[2]", 0, 8) + "," + entry("x", "[2]", 0, 8) + "}"), "a.safetensors:x");
  EXPECT_EQ(where_of("{" + entry("x", "[4611686018427387904,4611686018427387904]", 0, 8) + "}"), "a.safetensors:x");
  EXPECT_EQ(where_of("{" + entry("x", "[1,1,1,1,1,1,1,1,2]", 0, 8) + "}"), "a.safetensors:x") << "nine dimensions";
}

TEST(Safetensors, AHeaderOfAnythingElseIsRefused) {
  // Each is whole but for one thing, which the message names.
  const auto message_of = [](const std::string& header, const std::string& data) {
    const auto file = TensorFile::parse(file_of(header, data), "a.safetensors");
    return file ? "accepted" : file.error().message;
  };
  const auto belongs = [](const std::string& found) { return "the header has " + found + " where none belongs"; };
  const auto header_of = [&](const std::string& header) { return message_of(header, ""); };
  EXPECT_EQ(header_of("{}"), "accepted");
  EXPECT_EQ(header_of(""), "not valid JSON: it goes wrong at byte 1");
  EXPECT_EQ(header_of("{"), "not valid JSON: it goes wrong at byte 2");
  EXPECT_EQ(header_of("[]"), belongs("an array"));
  EXPECT_EQ(header_of("7"), belongs("a number"));
  EXPECT_EQ(header_of("null"), belongs("null"));
  EXPECT_EQ(header_of("\"x\""), belongs("a string"));
  EXPECT_EQ(header_of(std::string(1 << 20, '[')), belongs("an array")) << "a header that is deep";
  EXPECT_EQ(header_of("{\"x\":7}"), belongs("a number"));
  EXPECT_EQ(header_of("{\"x\":[7]}"), belongs("an array"));
  EXPECT_EQ(header_of("{\"x\":{}}"), "expected dtype, shape and two data_offsets");
  EXPECT_EQ(header_of("{\"__metadata__\":{\"a\":\"b\"}}"), "accepted");
  EXPECT_EQ(header_of("{\"__metadata__\":{\"a\":1}}"), belongs("a number"));
  EXPECT_EQ(header_of("{\"__metadata__\":{\"a\":[]}}"), belongs("an array"));
  EXPECT_EQ(header_of("{\"__metadata__\":{\"a\":{}}}"), belongs("an object"));

  const auto fields = [&](const std::string& text) {
    return message_of("{\"x\":{" + text + "}}", std::string(8, '\0'));
  };
  const std::string dtype = R"("dtype":"F32")", shape = R"("shape":[2])", offsets = R"("data_offsets":[0,8])";
  const std::string incomplete = "expected dtype, shape and two data_offsets";
  EXPECT_EQ(fields(dtype + "," + shape + "," + offsets), "accepted");
  EXPECT_EQ(fields(shape + "," + offsets), incomplete);
  EXPECT_EQ(fields(dtype + "," + offsets), incomplete);
  EXPECT_EQ(fields(dtype + "," + shape), incomplete);
  EXPECT_EQ(fields(dtype + "," + shape + R"(,"data_offsets":[0])"), incomplete);
  EXPECT_EQ(fields(dtype + "," + shape + R"(,"data_offsets":[0,8,9])"), belongs("a third offset"));
  EXPECT_EQ(fields(R"("dtype":7,)" + shape + "," + offsets), belongs("a number"));
  EXPECT_EQ(fields(R"("dtype":{},)" + shape + "," + offsets), belongs("an object"));
  EXPECT_EQ(fields(R"("dtype":["F32"],)" + shape + "," + offsets), belongs("an array"));
  EXPECT_EQ(fields(dtype + R"(,"shape":2,)" + offsets), belongs("a number"));
  EXPECT_EQ(fields(dtype + R"(,"shape":"2",)" + offsets), belongs("a string"));
  EXPECT_EQ(fields(dtype + R"(,"shape":[[2]],)" + offsets), belongs("an array"));
  EXPECT_EQ(fields(dtype + R"(,"shape":[-2],)" + offsets), belongs("a negative number"));
  EXPECT_EQ(fields(dtype + R"(,"shape":[2.0],)" + offsets), belongs("a fraction"));
  EXPECT_EQ(fields(dtype + R"(,"shape":[true],)" + offsets), belongs("true or false"));
  EXPECT_EQ(fields(dtype + R"(,"shape":[null],)" + offsets), belongs("null"));
  EXPECT_EQ(fields(dtype + "," + shape + "," + offsets + R"(,"strides":"1")"), belongs("another field"));
  EXPECT_EQ(fields(dtype + "," + dtype + "," + shape + "," + offsets), "its dtype stands there twice");
  EXPECT_EQ(fields(dtype + R"(,"shape":[1],"shape":[2],)" + offsets), "its shape stands there twice");
  EXPECT_EQ(fields(dtype + "," + shape + R"(,"data_offsets":[0],"data_offsets":[8])"),
            "its data_offsets stands there twice");
}

TEST(Safetensors, AHeaderThatAsksForTooMuchIsRefusedBeforeItIsRead) {
  std::string bytes(16, '\xff');
  bytes[7] = '\x7f';
  auto file = TensorFile::parse(bytes_of(bytes), "a");
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().code, ErrorCode::too_large);
  std::string header = "{";
  for (std::size_t i = 0; i <= max_tensors; ++i)
    header += (i == 0 ? "\"" : ",\"") + std::to_string(i) + R"(":{"dtype":"F32","shape":[0],"data_offsets":[0,0]})";
  file = TensorFile::parse(file_of(header + "}", ""), "a");
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().code, ErrorCode::too_large);
  const auto texts = [](std::size_t count) {
    std::string all;
    for (std::size_t i = 0; i < count; ++i) all += (i == 0 ? "\"" : ",\"") + std::to_string(i) + "\":\"\"";
    return TensorFile::parse(file_of("{\"__metadata__\":{" + all + "}}", ""), "a");
  };
  EXPECT_TRUE(texts(max_metadata));
  EXPECT_EQ(texts(max_metadata + 1).error().code, ErrorCode::too_large);
}

TEST(Safetensors, AFileCutAnywhereIsRefused) {
  const auto whole = bytes_of(encode_tensors({{"x", {{3}, {1, 2, 3}}}, {"y", {{2}, {4, 5}}}}));
  ASSERT_TRUE(TensorFile::parse(whole, "a"));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto file = TensorFile::parse({whole.begin(), whole.begin() + std::ptrdiff_t(size)}, "a");
    ASSERT_FALSE(file) << size;
    EXPECT_FALSE(file.error().where.empty()) << size;
  }
}

TEST(Safetensors, PicklesAreRefusedByNameAndByTheirBytes) {
  for (const char* name : {"a.ckpt", "a.pt", "a.pth", "a.bin"}) {
    const auto file = TensorFile::parse(bytes_of(encode_tensors({})), name);
    ASSERT_FALSE(file) << name;
    EXPECT_EQ(file.error().code, ErrorCode::unsupported);
    EXPECT_NE(file.error().message.find("pickle"), std::string::npos);
  }
  const std::string zip("PK\x03\x04\x14\x00\x00\x00\x08\x08", 10), pickle("\x80\x02}q\x00(X\x05", 8);
  // From protocol 4 on the length of a part stands at the third byte.
  const std::string fourth("\x80\x04\x95\x0f\0\0\0\0\0\0\0}", 12), fifth("\x80\x05\x95\0\x01\0\0\0\0\0\0}", 12);
  for (const std::string& bytes : {zip, pickle, fourth, fifth}) {
    const auto file = TensorFile::parse(bytes_of(bytes), "a.safetensors");
    ASSERT_FALSE(file);
    EXPECT_NE(file.error().message.find("pickle"), std::string::npos);
  }
  const std::string entries(0x280 - 2, ' ');
  EXPECT_TRUE(TensorFile::parse(file_of("{" + entries + "}", ""), "a")) << "a header's length may begin like a pickle";
}

TEST(Safetensors, WhatIsNoFileIsSaidToBeNone) {
  support::TempDir folder;
  EXPECT_EQ(TensorFile::open(folder.path() / "none.safetensors").error().code, ErrorCode::not_found);
  EXPECT_EQ(TensorFile::open(folder.path()).error().code, ErrorCode::invalid_argument);
  support::write_file(folder.path() / "empty.safetensors", "");
  EXPECT_EQ(TensorFile::open(folder.path() / "empty.safetensors").error().where, "empty.safetensors:header");
}

}  // namespace
}  // namespace engine::weights
