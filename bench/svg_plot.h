// Line charts as SVG text: enough for the figures of the documentation.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace bench {

struct Series {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< (x, y); positive on a logarithmic axis.
};

enum class Scale { logarithmic, linear };

struct Chart {
  std::string title, x_label, y_label;
  std::vector<Series> series;
  Scale x_scale = Scale::logarithmic, y_scale = Scale::logarithmic;
};

/// The charts side by side in one picture.
[[nodiscard]] std::string to_svg(const std::vector<Chart>& charts);

}  // namespace bench
