#include "bench/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace bench {
namespace {

constexpr double panel_width = 460, panel_height = 340, left = 70, right = 20, top = 40, bottom = 55;
constexpr std::array colours{"#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#e07b00", "#17818f"};

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string text(double x, double y, const std::string& anchor, const std::string& content,
                 const std::string& more = "") {
  return "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\" text-anchor=\"" + anchor + "\"" + more + ">" + content +
         "</text>\n";
}

std::string decade(int exponent) {
  if (exponent >= 6) return number(std::pow(10.0, exponent - 6)) + " M";
  if (exponent >= 3) return number(std::pow(10.0, exponent - 3)) + " k";
  return number(std::pow(10.0, exponent));
}

/// From values to pixels, with lines at round values: whole decades, or about five steps.
struct Axis {
  Scale scale;
  double low, high;  ///< Of positions: exponents of ten, or the values themselves.
  double step;       ///< Between lines, in positions.
  double from, to;   ///< Pixels.

  [[nodiscard]] double position(double value) const { return scale == Scale::logarithmic ? std::log10(value) : value; }
  [[nodiscard]] double pixel(double place) const { return from + (place - low) / (high - low) * (to - from); }
  [[nodiscard]] double at(double value) const { return pixel(position(value)); }
  [[nodiscard]] int lines() const { return int(std::lround((high - low) / step)) + 1; }
  [[nodiscard]] double line(int i) const { return low + i * step; }
  [[nodiscard]] std::string label(int i) const {
    return scale == Scale::logarithmic ? decade(int(std::lround(line(i)))) : number(line(i));
  }
};

/// 1, 2 or 5 times a power of ten, not below `least`.
double round_step(double least) {
  const double decade_below = std::pow(10.0, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * decade_below >= least * (1 - 1e-9)) return factor * decade_below;
  return 10 * decade_below;
}

Axis axis_over(const Chart& chart, bool x_axis, double from, double to) {
  Axis axis{
      .scale = x_axis ? chart.x_scale : chart.y_scale, .low = 1e9, .high = -1e9, .step = 1, .from = from, .to = to};
  for (const Series& series : chart.series)
    for (const auto& [x, y] : series.points) {
      const double position = axis.position(x_axis ? x : y);
      axis.low = std::min(axis.low, position), axis.high = std::max(axis.high, position);
    }
  if (axis.scale == Scale::linear) axis.step = round_step(std::max((axis.high - axis.low) / 5, 1e-9));
  axis.low = axis.step * std::floor(axis.low / axis.step + 1e-9);
  axis.high = axis.step * std::ceil(axis.high / axis.step - 1e-9);
  if (axis.high <= axis.low) axis.high = axis.low + axis.step;
  return axis;
}

std::string panel(const Chart& chart, double x0) {
  const Axis x = axis_over(chart, true, x0 + left, x0 + panel_width - right);
  const Axis y = axis_over(chart, false, panel_height - bottom, top);
  std::string out = text(x0 + panel_width / 2, 22, "middle", chart.title, " font-weight=\"bold\"");
  for (int i = 0; i < x.lines(); ++i) {
    const double at = x.pixel(x.line(i));
    out += "<line x1=\"" + number(at) + "\" y1=\"" + number(y.from) + "\" x2=\"" + number(at) + "\" y2=\"" +
           number(y.to) + "\" stroke=\"#ddd\"/>\n" + text(at, y.from + 18, "middle", x.label(i));
  }
  for (int i = 0; i < y.lines(); ++i) {
    const double at = y.pixel(y.line(i));
    out += "<line x1=\"" + number(x.from) + "\" y1=\"" + number(at) + "\" x2=\"" + number(x.to) + "\" y2=\"" +
           number(at) + "\" stroke=\"#ddd\"/>\n" + text(x.from - 8, at + 4, "end", y.label(i));
  }
  out += text((x.from + x.to) / 2, panel_height - 14, "middle", chart.x_label);
  const std::string middle = number((y.from + y.to) / 2), edge = number(x0 + 16);
  out += "<text transform=\"translate(" + edge + " " + middle + ") rotate(-90)\" text-anchor=\"middle\">" +
         chart.y_label + "</text>\n";
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    const std::string colour = colours[s % colours.size()];
    std::string path;
    for (const auto& [px, py] : chart.series[s].points) {
      path += (path.empty() ? "M" : " L") + number(x.at(px)) + " " + number(y.at(py));
      out +=
          "<circle cx=\"" + number(x.at(px)) + "\" cy=\"" + number(y.at(py)) + "\" r=\"3\" fill=\"" + colour + "\"/>\n";
    }
    out += "<path d=\"" + path + "\" fill=\"none\" stroke=\"" + colour + "\" stroke-width=\"1.5\"/>\n";
    out += text(x.from + 8, y.to + 16 + 16 * double(s), "start", chart.series[s].name, " fill=\"" + colour + "\"");
  }
  return out;
}

}  // namespace

std::string to_svg(const std::vector<Chart>& charts) {
  const std::string width = number(panel_width * double(charts.size())), height = number(panel_height);
  std::string out =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + width + "\" height=\"" + height +
      "\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  for (std::size_t i = 0; i < charts.size(); ++i) out += panel(charts[i], panel_width * double(i));
  return out + "</svg>\n";
}

}  // namespace bench
