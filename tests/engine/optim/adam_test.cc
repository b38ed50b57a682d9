#include "engine/optim/adam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace engine::optim {
namespace {

std::vector<float> normals(std::size_t n, std::uint64_t seed) {
  std::vector<float> values(n);
  Rng rng(seed);
  for (float& value : values) value = rng.normal();
  return values;
}

/// Kingma and Ba, algorithm 1, for one parameter, in double.
class ScalarAdam {
 public:
  double step(double value, double gradient, double rate) {
    ++t_;
    m_ = 0.9 * m_ + 0.1 * gradient;
    v_ = 0.999 * v_ + 0.001 * gradient * gradient;
    return value - rate * (m_ / (1 - std::pow(0.9, t_))) / (std::sqrt(v_ / (1 - std::pow(0.999, t_))) + 1e-8);
  }

 private:
  int t_ = 0;
  double m_ = 0, v_ = 0;
};

TEST(Adam, FollowsTheScalarAlgorithm) {
  constexpr std::size_t rows = 37, columns = 3;
  const std::vector<double> one_rate{0.01}, rates{0.1, 0.0, 0.003};
  Adam adam({{"a", 1}, {"b", columns}}, rows, {.epsilon = 1e-8});
  std::vector<float> a = normals(rows, 1), b = normals(rows * columns, 2);
  std::vector<double> expected_a(a.begin(), a.end()), expected_b(b.begin(), b.end());
  std::vector<ScalarAdam> scalar_a(rows), scalar_b(rows * columns);
  for (std::uint64_t t = 0; t < 50; ++t) {
    const auto v_a = normals(rows, 100 + t), v_b = normals(rows * columns, 200 + t);
    const std::vector<AdamGroup> groups{{a, v_a, one_rate}, {b, v_b, rates}};
    ASSERT_TRUE(adam.step(groups));
    for (std::size_t i = 0; i < a.size(); ++i) expected_a[i] = scalar_a[i].step(expected_a[i], v_a[i], 0.01);
    for (std::size_t i = 0; i < b.size(); ++i)
      expected_b[i] = scalar_b[i].step(expected_b[i], v_b[i], rates[i % columns]);
  }
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], expected_a[i], 1e-5) << "a, row " << i;
  for (std::size_t i = 0; i < b.size(); ++i) EXPECT_NEAR(b[i], expected_b[i], 1e-5) << "b, value " << i;
  EXPECT_EQ(adam.steps(), 50u);
}

TEST(Adam, UnderAConstantGradientEachStepIsTheRate) {
  // Bias correction makes both means equal to the gradient from the first step on.
  const std::vector<double> rate{0.25};
  for (const float gradient : {1e-6f, -3.0f, 1e8f}) {
    Adam adam({{"x"}}, 1);
    std::vector<float> value{0};
    for (int t = 1; t <= 20; ++t) {
      ASSERT_TRUE(adam.step(std::vector<AdamGroup>{{value, std::span(&gradient, 1), rate}}));
      EXPECT_NEAR(value[0], (gradient > 0 ? -0.25 : 0.25) * t, 1e-4 * t) << "step " << t << ", gradient " << gradient;
    }
  }
}

TEST(Adam, AZeroGradientMovesNothing) {
  Adam adam({{"x"}}, 3);
  std::vector<float> value{1, -2, 0};
  const std::vector<float> gradient(3), before = value;
  const std::vector<double> rate{1};
  for (int t = 0; t < 5; ++t) ASSERT_TRUE(adam.step(std::vector<AdamGroup>{{value, gradient, rate}}));
  EXPECT_EQ(value, before);
}

TEST(Adam, MobilityMultipliesTheRatesOfARow) {
  constexpr std::size_t rows = 37, columns = 3;
  const std::vector<double> one_rate{0.01}, rates{0.1, 0.0, 0.003};
  std::vector<float> mobility(rows);
  for (std::size_t row = 0; row < rows; ++row) mobility[row] = float(row % 5) / 2;  // 0 to 2
  Adam adam({{"a", 1}, {"b", columns}}, rows, {.epsilon = 1e-8});
  std::vector<float> a = normals(rows, 1), b = normals(rows * columns, 2);
  const std::vector<float> first_a = a, first_b = b;
  std::vector<double> expected_a(a.begin(), a.end()), expected_b(b.begin(), b.end());
  std::vector<ScalarAdam> scalar_a(rows), scalar_b(rows * columns);
  for (std::uint64_t t = 0; t < 50; ++t) {
    const auto v_a = normals(rows, 100 + t), v_b = normals(rows * columns, 200 + t);
    ASSERT_TRUE(adam.step(std::vector<AdamGroup>{{a, v_a, one_rate, mobility}, {b, v_b, rates, mobility}}));
    for (std::size_t i = 0; i < rows; ++i)
      expected_a[i] = scalar_a[i].step(expected_a[i], v_a[i], 0.01 * double(mobility[i]));
    for (std::size_t i = 0; i < b.size(); ++i)
      expected_b[i] = scalar_b[i].step(expected_b[i], v_b[i], rates[i % columns] * double(mobility[i / columns]));
  }
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], expected_a[i], 1e-5) << "a, row " << i;
  for (std::size_t i = 0; i < b.size(); ++i) EXPECT_NEAR(b[i], expected_b[i], 1e-5) << "b, value " << i;
  for (std::size_t i = 0; i < rows; i += 5) EXPECT_EQ(a[i], first_a[i]) << "row " << i << " is not to move";
  for (std::size_t i = 0; i < rows; i += 5) EXPECT_EQ(b[columns * i], first_b[columns * i]) << "row " << i;
}

TEST(Adam, EveryGroupHasAMobilityOfItsOwn) {
  const std::vector<double> rate{0.25};
  const std::vector<float> gradient{1, 1}, first_alone{1, 0};
  std::vector<float> a{0, 0}, b{0, 0};
  Adam adam({{"a"}, {"b"}}, 2);
  ASSERT_TRUE(adam.step(std::vector<AdamGroup>{{a, gradient, rate, first_alone}, {b, gradient, rate}}));
  EXPECT_LT(a[0], 0.0f);
  EXPECT_EQ(a[1], 0.0f);
  EXPECT_EQ(b, (std::vector<float>{a[0], a[0]}));
}

TEST(Adam, AMobilityOfOneEverywhereIsTheSameAsNone) {
  constexpr std::size_t rows = 300;
  const std::vector<double> rate{0.01}, rates{0.1, 0.2};
  const auto optimise = [&](std::span<const float> mobility) {
    Adam adam({{"a", 1}, {"b", 2}}, rows);
    std::vector<float> a = normals(rows, 1), b = normals(rows * 2, 2);
    for (std::uint64_t t = 0; t < 3; ++t) {
      const auto v_a = normals(rows, 10 + t), v_b = normals(rows * 2, 20 + t);
      EXPECT_TRUE(adam.step(std::vector<AdamGroup>{{a, v_a, rate, mobility}, {b, v_b, rates, mobility}}));
    }
    return std::pair{a, b};
  };
  EXPECT_EQ(optimise({}), optimise(std::vector<float>(rows, 1.0f)));
}

TEST(Adam, ARowThatMayNotMoveRemembersItsGradientsAllTheSame) {
  const std::vector<double> rate{0.25};
  const std::vector<float> gradient{1, 1}, none(2);
  std::vector<float> value{0, 0};
  Adam adam({{"x"}}, 2);
  const std::vector<float> second_alone{0, 1};
  ASSERT_TRUE(adam.step(std::vector<AdamGroup>{{value, gradient, rate, second_alone}}));
  EXPECT_EQ(value[0], 0.0f);
  const float before = value[1];
  ASSERT_TRUE(adam.step(std::vector<AdamGroup>{{value, none, rate}}));
  EXPECT_LT(value[0], 0.0f);
  EXPECT_FLOAT_EQ(value[0], value[1] - before);
}

TEST(Adam, HasTheSameBytesForAnyNumberOfThreads) {
  constexpr std::size_t rows = 40000;
  const std::vector<double> rate{0.01}, rates{0.1, 0.2, 0.3, 0.4};
  std::vector<float> mobilities(rows);
  for (std::size_t row = 0; row < rows; ++row) mobilities[row] = float(row % 7) / 6;
  auto optimise = [&](int threads, std::span<const float> mobility) {
    std::vector<float> a = normals(rows, 1), b = normals(rows * 4, 2);
    WorkArena(threads).run([&] {
      Adam adam({{"a", 1}, {"b", 4}}, rows);
      for (std::uint64_t t = 0; t < 3; ++t) {
        const auto v_a = normals(rows, 10 + t), v_b = normals(rows * 4, 20 + t);
        EXPECT_TRUE(adam.step(std::vector<AdamGroup>{{a, v_a, rate, mobility}, {b, v_b, rates, mobility}}));
      }
    });
    return std::pair{a, b};
  };
  EXPECT_EQ(optimise(1, {}), optimise(4, {}));
  EXPECT_EQ(optimise(1, mobilities), optimise(4, mobilities));
}

TEST(Adam, NamesTheFirstPoisonedParameter) {
  constexpr std::size_t rows = 30000;
  const std::vector<double> rate{0.01};
  for (const float poison : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    Adam adam({{"mean.x"}, {"sh", 3}}, rows);
    std::vector<float> x(rows), sh(rows * 3), v_x(rows), v_sh(rows * 3);
    v_sh[3 * 29999] = poison;
    v_sh[3 * 1204 + 2] = poison;
    const auto poisoned = adam.step(std::vector<AdamGroup>{{x, v_x, rate}, {sh, v_sh, rate}});
    ASSERT_FALSE(poisoned);
    EXPECT_EQ(poisoned.error().where, "[1204].sh[2]");
    EXPECT_EQ(poisoned.error().code, ErrorCode::internal);
    EXPECT_NE(poisoned.error().message.find("gradient"), std::string::npos);
    EXPECT_NE(poisoned.error().message.find("step 1"), std::string::npos);
  }
}

TEST(Adam, NamesAParameterThatOverflows) {
  // The square of the gradient is no float: its moment would be infinite and the parameter would never move again.
  Adam adam({{"opacity"}}, 2);
  std::vector<float> value{0, 0};
  const std::vector<float> gradient{1, 1e30f};
  const std::vector<double> rate{0.01};
  const auto poisoned = adam.step(std::vector<AdamGroup>{{value, gradient, rate}});
  ASSERT_FALSE(poisoned);
  EXPECT_EQ(poisoned.error().where, "[1].opacity");
  EXPECT_NE(poisoned.error().message.find("overflowed"), std::string::npos);
}

TEST(Adam, RowsThatStayKeepTheirMomentsAndNewOnesBeginWithNone) {
  const std::vector<double> rate{0.01};
  Adam adam({{"x", 2}}, 3);
  std::vector<float> value{0, 1, 2, 3, 4, 5};
  const std::vector<float> gradient{1, 2, 3, 4, 5, 6};
  ASSERT_TRUE(adam.step(std::vector<AdamGroup>{{value, gradient, rate}}));
  adam.keep_rows(std::vector<std::uint8_t>{1, 0, 1});
  adam.append_rows(1);
  ASSERT_EQ(adam.rows(), 3u);
  std::vector<float> kept{0, 0, 0, 0, 0, 0};
  const std::vector<float> none(6);
  ASSERT_TRUE(adam.step(std::vector<AdamGroup>{{kept, none, rate}}));
  // Without a gradient, what is left of the first moment moves the old rows (all by the same: Adam knows no size).
  const double coasting = 0.01 * (0.09 / 0.19) / std::sqrt(0.000999 / 0.001999);
  for (const std::size_t i : {0, 1, 2, 3}) EXPECT_NEAR(kept[i], -coasting, 1e-6) << "value " << i;
  for (const std::size_t i : {4, 5}) EXPECT_EQ(kept[i], 0.0f);
}

TEST(Adam, OfNoRowsDoesNothing) {
  Adam adam({{"x", 3}}, 0);
  const std::vector<double> rate{0.01};
  EXPECT_TRUE(adam.step(std::vector<AdamGroup>{{{}, {}, rate}}));
}

TEST(AdamOptions, ThatMakeNoSenseAreNamed) {
  EXPECT_TRUE(validate(AdamOptions{}));
  EXPECT_EQ(validate(AdamOptions{.beta1 = 1}).error().where, "beta1");
  EXPECT_EQ(validate(AdamOptions{.beta2 = -0.1}).error().where, "beta2");
  EXPECT_EQ(validate(AdamOptions{.epsilon = 0}).error().where, "epsilon");
  EXPECT_EQ(validate(AdamOptions{.epsilon = 1e-60}).error().where, "epsilon");  // zero as a float
}

}  // namespace
}  // namespace engine::optim
