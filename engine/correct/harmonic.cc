#include "engine/correct/harmonic.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <vector>

namespace engine::correct {
namespace {

// Length of the residual at which the solver stops, as a part of that of a flat start. A choice.
constexpr double tolerance = 1e-5;
constexpr std::uint32_t nowhere = ~std::uint32_t{0};

/// The graph of unknown pixels. Each has up to four neighbours, unknown or known.
struct UnknownPixels {
  std::vector<std::size_t> pixel;        ///< [n] index in a plane
  std::vector<std::uint32_t> neighbour;  ///< [n][4] number of an unknown pixel, or nowhere
  std::vector<std::size_t> known;        ///< [n][4] index of a known pixel, where neighbour is nowhere
  std::vector<std::uint8_t> known_flag;  ///< [n][4]
  std::vector<double> degree;            ///< [n] neighbours of both kinds
};

/// Unknown pixels that are joined, by unknown ones, to a known one.
std::vector<std::uint8_t> anchored(const scene::Mask& unknown) {
  std::vector<std::uint8_t> out(unknown.data.size(), 0);
  std::vector<std::size_t> front;
  const int width = unknown.width, height = unknown.height;
  for (std::size_t i = 0; i < unknown.data.size(); ++i)
    if (unknown.data[i] == 0) front.push_back(i);
  while (!front.empty()) {
    const std::size_t i = front.back();
    front.pop_back();
    const int x = int(i % std::size_t(width)), y = int(i / std::size_t(width));
    const auto reach = [&](int nx, int ny) {
      if (nx < 0 || ny < 0 || nx >= width || ny >= height) return;
      const std::size_t n = std::size_t(ny) * std::size_t(width) + std::size_t(nx);
      if (unknown.data[n] != 0 && out[n] == 0) out[n] = 1, front.push_back(n);
    };
    reach(x - 1, y), reach(x + 1, y), reach(x, y - 1), reach(x, y + 1);
  }
  return out;
}

UnknownPixels unknown_pixels(const scene::Mask& unknown) {
  const std::vector<std::uint8_t> solvable = anchored(unknown);
  std::vector<std::uint32_t> number(solvable.size(), nowhere);
  UnknownPixels graph;
  for (std::size_t i = 0; i < solvable.size(); ++i)
    if (solvable[i] != 0) number[i] = std::uint32_t(graph.pixel.size()), graph.pixel.push_back(i);
  const std::size_t n = graph.pixel.size();
  graph.neighbour.assign(4 * n, nowhere), graph.known.assign(4 * n, 0), graph.known_flag.assign(4 * n, 0);
  graph.degree.assign(n, 0);
  for (std::size_t k = 0; k < n; ++k) {
    const int x = int(graph.pixel[k] % std::size_t(unknown.width)),
              y = int(graph.pixel[k] / std::size_t(unknown.width));
    const int dx[4] = {-1, 1, 0, 0}, dy[4] = {0, 0, -1, 1};
    for (std::size_t side = 0; side < 4; ++side) {
      const int nx = x + dx[side], ny = y + dy[side];
      if (nx < 0 || ny < 0 || nx >= unknown.width || ny >= unknown.height) continue;
      const std::size_t j = std::size_t(ny) * std::size_t(unknown.width) + std::size_t(nx);
      graph.degree[k] += 1;
      graph.neighbour[4 * k + side] = number[j];
      if (number[j] == nowhere) graph.known[4 * k + side] = j, graph.known_flag[4 * k + side] = 1;
    }
  }
  return graph;
}

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

/// out = degree x - the sum of x over unknown neighbours: the discrete Laplacian, negated.
void apply(const UnknownPixels& graph, const std::vector<double>& x, std::vector<double>& out) {
  for (std::size_t k = 0; k < x.size(); ++k) {
    double value = graph.degree[k] * x[k];
    for (std::size_t side = 0; side < 4; ++side)
      if (const std::uint32_t j = graph.neighbour[4 * k + side]; j != nowhere) value -= x[j];
    out[k] = value;
  }
}

}  // namespace

void fill_harmonic(scene::Image& image, const scene::Mask& unknown) {
  assert(image.width == unknown.width && image.height == unknown.height);
  const UnknownPixels graph = unknown_pixels(unknown);
  const std::size_t n = graph.pixel.size();
  if (n == 0) return;
  std::vector<double> x(n), residual(n), direction(n), image_of(n);
  for (int c = 0; c < image.channels; ++c) {
    const auto plane = image.plane(c);
    double mean = 0, count = 0;
    for (std::size_t k = 0; k < 4 * n; ++k)
      if (graph.known_flag[k] != 0) mean += double(plane[graph.known[k]]), count += 1;
    std::fill(x.begin(), x.end(), mean / count);
    apply(graph, x, image_of);
    for (std::size_t k = 0; k < n; ++k) {
      double known = 0;
      for (std::size_t side = 0; side < 4; ++side)
        if (graph.known_flag[4 * k + side] != 0) known += double(plane[graph.known[4 * k + side]]);
      residual[k] = known - image_of[k];
    }
    direction = residual;
    double length = dot(residual, residual);
    const double enough = tolerance * tolerance * length;
    // n steps suffice in exact arithmetic; rounding makes it a bound that is never met in practice.
    for (std::size_t step = 0; step < n && length > enough; ++step) {
      apply(graph, direction, image_of);
      const double along = length / dot(direction, image_of);
      for (std::size_t k = 0; k < n; ++k) x[k] += along * direction[k], residual[k] -= along * image_of[k];
      const double next = dot(residual, residual);
      for (std::size_t k = 0; k < n; ++k) direction[k] = residual[k] + next / length * direction[k];
      length = next;
    }
    for (std::size_t k = 0; k < n; ++k) plane[graph.pixel[k]] = float(x[k]);
  }
}

}  // namespace engine::correct
