#include "tests/support/gradient_matches.h"

#include <algorithm>
#include <cmath>

namespace support {

testing::AssertionResult gradient_matches(const std::function<double(const std::vector<double>&)>& f,
                                          const std::vector<double>& x, const std::vector<double>& gradient,
                                          GradientCheck check) {
  if (gradient.size() != x.size())
    return testing::AssertionFailure() << "a gradient of " << gradient.size() << " components for " << x.size()
                                       << " arguments";
  std::vector<double> numeric(x.size());
  double largest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const auto at = [&](double offset) {
      std::vector<double> moved = x;
      moved[i] += offset;
      return f(moved);
    };
    const double h = check.step;
    numeric[i] = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
    largest = std::max(largest, std::abs(numeric[i]));
  }
  for (std::size_t i = 0; i < x.size(); ++i)
    if (!(std::abs(gradient[i] - numeric[i]) <= check.rtol * (std::abs(numeric[i]) + 0.01 * largest)))
      return testing::AssertionFailure() << "component " << i << " is " << gradient[i] << ", central differences give "
                                         << numeric[i] << " (largest component: " << largest << ")";
  return testing::AssertionSuccess();
}

}  // namespace support
