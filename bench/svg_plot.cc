#include "bench/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace bench {
namespace {

constexpr double panel_width = 460, panel_height = 340, left = 70, right = 20, top = 40, bottom = 55;
constexpr std::array colours{"#1f77b4", "#d62728", "#2ca02c", "#9467bd"};

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

/// A logarithmic axis over whole decades.
struct Axis {
  double low = 0, high = 1;  // exponents of ten
  double from, to;           // pixels

  [[nodiscard]] double at(double value) const { return from + (std::log10(value) - low) / (high - low) * (to - from); }
};

Axis axis_over(const Chart& chart, bool x_axis, double from, double to) {
  Axis axis{.low = 1e9, .high = -1e9, .from = from, .to = to};
  for (const Series& series : chart.series)
    for (const auto& [x, y] : series.points) {
      const double exponent = std::log10(x_axis ? x : y);
      axis.low = std::min(axis.low, std::floor(exponent + 1e-9));
      axis.high = std::max(axis.high, std::ceil(exponent - 1e-9));
    }
  if (axis.high <= axis.low) axis.high = axis.low + 1;
  return axis;
}

std::string decade(int exponent) {
  if (exponent >= 6) return number(std::pow(10.0, exponent - 6)) + " M";
  if (exponent >= 3) return number(std::pow(10.0, exponent - 3)) + " k";
  return number(std::pow(10.0, exponent));
}

std::string panel(const Chart& chart, double x0) {
  const Axis x = axis_over(chart, true, x0 + left, x0 + panel_width - right);
  const Axis y = axis_over(chart, false, panel_height - bottom, top);
  std::string out = text(x0 + panel_width / 2, 22, "middle", chart.title, " font-weight=\"bold\"");
  for (int e = int(x.low); e <= int(x.high); ++e) {
    const double at = x.at(std::pow(10.0, e));
    out += "<line x1=\"" + number(at) + "\" y1=\"" + number(y.from) + "\" x2=\"" + number(at) + "\" y2=\"" +
           number(y.to) + "\" stroke=\"#ddd\"/>\n" + text(at, y.from + 18, "middle", decade(e));
  }
  for (int e = int(y.low); e <= int(y.high); ++e) {
    const double at = y.at(std::pow(10.0, e));
    out += "<line x1=\"" + number(x.from) + "\" y1=\"" + number(at) + "\" x2=\"" + number(x.to) + "\" y2=\"" +
           number(at) + "\" stroke=\"#ddd\"/>\n" + text(x.from - 8, at + 4, "end", decade(e));
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
