// Gradients against numbers.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <vector>

namespace support {

struct GradientCheck {
  double step = 1e-3;  ///< Of each argument. The error of the differences goes with its fourth power.
  double rtol = 1e-7;  ///< Of each component; a hundredth of that of the largest one is always allowed.
};

/// Is `gradient` that of f at x? Compared with five-point central differences, for f smooth within two steps of x.
/// A failure names the component and both values.
testing::AssertionResult gradient_matches(const std::function<double(const std::vector<double>&)>& f,
                                          const std::vector<double>& x, const std::vector<double>& gradient,
                                          GradientCheck check = {});

}  // namespace support
