#include "engine/io/palette.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/rng.h"

namespace engine::io {
namespace {

TEST(Codebook, HasEveryValueWhereTheyAreFew) {
  std::vector<float> values;
  for (int k = 0; k < 1000; ++k) values.push_back(float(k % 256) * 0.37f - 20);
  const Codebook codebook = codebook_of(values);
  EXPECT_EQ(codebook.used, 256u);
  for (const float value : values) EXPECT_EQ(codebook.values[codebook.nearest(value)], value);
}

TEST(Codebook, OneValueAndNone) {
  EXPECT_EQ(codebook_of({}).values[0], 0.0f);
  const std::vector<float> same(50, 3.5f);
  const Codebook codebook = codebook_of(same);
  EXPECT_EQ(codebook.used, 1u);
  EXPECT_EQ(codebook.values[255], 3.5f);
  EXPECT_EQ(codebook.nearest(-1e30f), 0);
}

// Panter and Dite 1951: the least mean square error of n levels for a density p is (integral of p^(1/3))^3 / (12 n^2);
// of a normal distribution, sqrt(3) pi / (2 n^2).
TEST(Codebook, ComesNearTheLeastErrorThatAnyHas) {
  Rng rng(1);
  std::vector<float> values(200'000);
  for (float& value : values) value = rng.normal();
  const Codebook codebook = codebook_of(values);
  double square = 0;
  for (const float value : values)
    square += std::pow(double(value) - double(codebook.values[codebook.nearest(value)]), 2);
  const double least = std::sqrt(3.0) * 3.14159265 / (2 * 256.0 * 256.0);
  EXPECT_LT(square / double(values.size()), 1.25 * least);
  EXPECT_TRUE(std::is_sorted(codebook.values.begin(), codebook.values.end()));
}

TEST(Palette, IsExactWhereRowsAreFew) {
  Rng rng(2);
  std::vector<float> kinds(20 * 6), rows;
  for (float& value : kinds) value = rng.normal();
  for (std::size_t i = 0; i < 500; ++i) {
    const std::size_t kind = rng.below(20);
    rows.insert(rows.end(), kinds.begin() + std::ptrdiff_t(6 * kind), kinds.begin() + std::ptrdiff_t(6 * kind + 6));
  }
  const Palette palette = palette_of(rows, 6, 4, 20);
  ASSERT_EQ(palette.entries.size(), 120u);
  for (std::size_t i = 0; i < 500; ++i)
    for (std::size_t c = 0; c < 6; ++c) EXPECT_EQ(palette.entries[6 * palette.labels[i] + c], rows[6 * i + c]);
}

TEST(Palette, FindsClustersThatAreFarApart) {
  Rng rng(3);
  std::vector<float> rows;
  for (std::size_t i = 0; i < 3000; ++i)
    for (std::size_t c = 0; c < 3; ++c) rows.push_back(float(i % 3 == c ? 100 : 0) + rng.normal());
  const Palette palette = palette_of(rows, 3, 3, 100);
  ASSERT_EQ(palette.entries.size(), 9u);
  for (std::size_t i = 0; i < 3000; ++i) EXPECT_NEAR(palette.entries[3 * palette.labels[i] + i % 3], 100, 0.5) << i;
}

TEST(Palette, ErrorFallsAsEntriesGrow) {
  Rng rng(4);
  std::vector<float> rows(2000 * 5);
  for (float& value : rows) value = rng.normal();
  double before = 1e30;
  for (const std::size_t entries : {1, 4, 16, 64, 256, 1024}) {
    const Palette palette = palette_of(rows, 5, entries, 10);
    EXPECT_EQ(palette.entries.size(), 5 * entries);
    double error = 0;
    for (std::size_t i = 0; i < 2000; ++i)
      for (std::size_t c = 0; c < 5; ++c)
        error += std::pow(double(palette.entries[5 * palette.labels[i] + c]) - double(rows[5 * i + c]), 2);
    EXPECT_LT(error, 0.85 * before) << entries;
    before = error;
  }
}

}  // namespace
}  // namespace engine::io
