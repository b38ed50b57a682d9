// How a fit comes nearer to its photos with time, from the reports of fits.
//
//   build/release/bench/fit_curve docs "all views=fit/report.json" "every 8th held out=held-out/report.json"
//
// writes docs/fit.md and docs/fit-curve.svg.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/svg_plot.h"

namespace {

using nlohmann::json;

struct Fit {
  std::string name;
  json report;
};

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

std::string summary(const Fit& fit) {
  const json& r = fit.report;
  const json& training = r.at("training");
  std::string row = "| " + fit.name +
                    format(" | %d | %d | %d | %.0f | %.2f | %.4f | %.2f |", r.at("views").get<int>(),
                           r.at("options").at("iterations").get<int>(), r.at("gaussians").get<int>(),
                           r.at("seconds").get<double>(), training.at("psnr_db").get<double>(),
                           training.at("ssim").get<double>(), training.at("worst_psnr_db").get<double>());
  const json& held_out = r.at("held_out");
  return row + (held_out.is_null() ? std::string(" | |\n")
                                   : format(" %.2f | %.4f |\n", held_out.at("psnr_db").get<double>(),
                                            held_out.at("ssim").get<double>()));
}

std::string curve(const Fit& fit) {
  std::string rows =
      "\n" + fit.name + ":\n\n| iteration | seconds | Gaussians | PSNR, dB |\n| ---: | ---: | ---: | ---: |\n";
  for (const json& point : fit.report.at("curve"))
    rows += format("| %d | %.0f | %d | %.2f |\n", point.at("iteration").get<int>(), point.at("seconds").get<double>(),
                   point.at("gaussians").get<int>(), point.at("psnr_db").get<double>());
  return rows;
}

bench::Chart chart(const std::vector<Fit>& fits) {
  bench::Chart out{"Training views", "seconds", "mean PSNR, dB", {}, bench::Scale::linear, bench::Scale::linear};
  for (const Fit& fit : fits) {
    out.series.push_back({fit.name, {}});
    for (const json& point : fit.report.at("curve"))
      out.series.back().points.emplace_back(point.at("seconds").get<double>(), point.at("psnr_db").get<double>());
  }
  return out;
}

std::string page(const std::vector<Fit>& fits) {
  const json& options = fits.front().report;
  std::string out =
      "# Fitting a scene to photos\n\n"
      "Fox capture: 50 photos of 359 x 640 pixels, from its 8,498 sparse points, " +
      format("%d threads", options.at("threads").get<int>()) + ", " + options.at("simd").get<std::string>() +
      ". Made by\n\n"
      "    build/release/splatdrag fit --dataset FOX --out fit\n"
      "    build/release/splatdrag fit --dataset FOX --out held-out --hold-out 8\n"
      "    build/release/bench/fit_curve docs \"all views=fit/report.json\" "
      "\"every 8th held out=held-out/report.json\"\n\n"
      "Seconds are those of fitting, with the measurements of the curve.\n\n"
      "| photos | views | iterations | Gaussians | seconds | PSNR, dB | SSIM | worst view, dB | held-out PSNR, dB | "
      "held-out SSIM |\n"
      "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";
  for (const Fit& fit : fits) out += summary(fit);
  out += "\n![](fit-curve.svg)\n";
  for (const Fit& fit : fits) out += curve(fit);
  return out;
}

void write(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file);
  if (!(out << text << std::flush)) throw std::runtime_error("cannot write " + file.string());
}

Fit load(const std::string& argument) {
  const std::size_t equals = argument.find('=');
  if (equals == std::string::npos) throw std::runtime_error("not NAME=REPORT: " + argument);
  std::ifstream file(argument.substr(equals + 1));
  if (!file) throw std::runtime_error("cannot read " + argument.substr(equals + 1));
  return {argument.substr(0, equals), json::parse(file)};
}

}  // namespace

int main(int count, char** arguments) try {
  if (count < 3) throw std::runtime_error("usage: fit_curve FOLDER NAME=REPORT...");
  std::vector<Fit> fits;
  for (int i = 2; i < count; ++i) fits.push_back(load(arguments[i]));
  const std::filesystem::path folder = arguments[1];
  write(folder / "fit-curve.svg", bench::to_svg({chart(fits)}));
  write(folder / "fit.md", page(fits));
} catch (const std::exception& error) {
  std::fprintf(stderr, "error: %s\n", error.what());
  return 2;
}
