// What speed costs in quality: each knob of an edit alone, the front of all of them, and what the presets buy.
//
//   build/release/bench/tradeoff build/release/splatdrag docs out/tradeoff
//
// writes docs/tradeoff.md and docs/tradeoff.svg from edits whose right result is known (`splatdrag bench-edit`), and
// from a drag of the fox capture and back ($SPLATDRAG_DATA, or shared/data beside the project).
// Results are kept in the last folder: what is there is not measured again, so that it may be interrupted. Half an hour
// on two cores, which it wants to itself.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/fox.h"
#include "bench/svg_plot.h"

namespace {

using nlohmann::json;
using std::filesystem::path;

/// What an edit came to, on the mean over cases.
struct SettingResult {
  std::string setting;
  double edited_db = 0, ssim = 0, vacated_db = 0, outside_db = 0, seconds = 0;
};

class Bench {
 public:
  Bench(std::string program, path results) : program_(std::move(program)), results_(std::move(results)) {}

  /// Every case at `standard` with every corrector, a row each.
  [[nodiscard]] std::string cases() const {
    std::ostringstream out;
    out << "| case | corrector | edited, dB | SSIM | vacated, dB | arrived, dB | outside, dB | s |\n"
           "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |\n"
        << std::fixed;
    const json found = run("bench.json", "--preset standard --corrector none --corrector harmonic --corrector scene");
    for (const json& each : found.at("cases")) {
      const auto of = [&](const char* kind, const char* what) {
        return each.at("result").at(kind).at(what).get<double>();
      };
      out << "| " << each.at("case").get<std::string>() << " | " << each.at("corrector").get<std::string>() << " | "
          << std::setprecision(2) << of("edited", "psnr_db") << " | " << std::setprecision(4) << of("edited", "ssim")
          << std::setprecision(2) << " | " << of("vacated", "psnr_db") << " | " << of("arrived", "psnr_db") << " | "
          << of("outside", "psnr_db") << " | " << std::setprecision(1) << each.at("seconds").get<double>() << " |\n";
    }
    return out.str();
  }

  /// A drag of the fox and back, with the corrector `scene`: a row of a table.
  [[nodiscard]] std::string trip(const std::string& setting, const std::string& arguments) const {
    const path fox = bench::fox_folder();
    const json found = run("trips.json", "--scene '" + (fox / "point_cloud.ply").string() + "' --dataset '" +
                                             (fox / "sparse/0").string() + "' --request '" +
                                             (fox / "drags.json").string() + "' --name ear_up " + arguments)
                           .at("trips")
                           .at(0);
    std::ostringstream out;
    out << "| " << setting << std::fixed << std::setprecision(1) << " | " << 100 * found.at("arrived").get<double>()
        << std::setprecision(2) << " | " << found.at("inside").at("psnr_db").get<double>() << " | "
        << std::setprecision(4) << found.at("inside").at("ssim").get<double>() << std::setprecision(2) << " | "
        << found.at("outside").at("psnr_db").get<double>() << " | " << std::setprecision(1)
        << found.at("seconds").get<double>() << " |\n";
    std::fprintf(stderr, "%s", out.str().c_str());
    return out.str();
  }

  /// Of the cases and corrector that the arguments of bench-edit name.
  [[nodiscard]] SettingResult measure(const std::string& setting, const std::string& arguments) const {
    const json found = run("bench.json", arguments);
    SettingResult point{.setting = setting};
    double textured = 0;
    const double cases = double(found.at("cases").size());
    for (const json& each : found.at("cases")) {
      const json& result = each.at("result");
      point.edited_db += result.at("edited").at("psnr_db").get<double>() / cases;
      point.ssim += result.at("edited").at("ssim").get<double>() / cases;
      point.outside_db += result.at("outside").at("psnr_db").get<double>() / cases;
      point.seconds += each.at("seconds").get<double>() / cases;
      if (!each.at("textured").get<bool>()) continue;
      point.vacated_db += result.at("vacated").at("psnr_db").get<double>();
      textured += 1;
    }
    if (textured > 0) point.vacated_db /= textured;
    std::fprintf(stderr, "%-40s %6.2f dB %8.2f s\n", setting.c_str(), point.edited_db, point.seconds);
    return point;
  }

 private:
  /// What bench-edit reports in that file.
  [[nodiscard]] json run(const std::string& report, const std::string& arguments) const {
    const std::string command =
        "'" + program_ + "' bench-edit --pictures 0 --out '" + results_.string() + "' " + arguments + " > /dev/null";
    if (std::system(command.c_str()) != 0) throw std::runtime_error("this failed: " + command);
    std::ifstream file(results_ / report);
    return json::parse(file);
  }

  std::string program_;
  path results_;
};

struct Knob {
  std::string name, flag;
  std::vector<std::string> values;
};

const std::vector<Knob>& knobs() {
  static const std::vector<Knob> all{{"intervals", "--intervals", {"1", "2", "5", "10", "20"}},
                                     {"iterations", "--iterations", {"1", "25", "50", "100", "200", "400", "800"}},
                                     {"annealing_steps", "--annealing-steps", {"1", "2", "4"}},
                                     {"views", "--views", {"2", "4", "8", "16", "24"}},
                                     {"max_image_side", "--image-side", {"80", "120", "160", "200", "240"}},
                                     {"interpolation", "--interpolation", {"paper", "smooth", "rigid"}},
                                     {"corrector", "--corrector", {"none", "harmonic", "scene"}}};
  return all;
}

std::string row(const SettingResult& point) {
  std::ostringstream out;
  out << "| " << point.setting << std::fixed << std::setprecision(2) << " | " << point.edited_db << " | "
      << std::setprecision(4) << point.ssim << std::setprecision(2) << " | " << point.vacated_db << " | "
      << point.outside_db << " | " << std::setprecision(point.seconds < 10 ? 2 : 1) << point.seconds << " |\n";
  return out.str();
}

const std::string trip_head =
    " | arrived, % | inside, dB | SSIM | outside, dB | s there |\n| --- | ---: | ---: | ---: | ---: | ---: |\n";

const std::string head =
    "| setting | edited, dB | SSIM | vacated, dB | outside, dB | s |\n| --- | ---: | ---: | ---: | ---: | ---: |\n";

bench::Series series(const std::string& name, const std::vector<SettingResult>& points) {
  bench::Series out{name, {}};
  for (const SettingResult& point : points) out.points.emplace_back(point.seconds, point.edited_db);
  std::sort(out.points.begin(), out.points.end());
  return out;
}

/// Those that no other one beats in both time and quality, by time.
std::vector<SettingResult> front(std::vector<SettingResult> points) {
  std::sort(points.begin(), points.end(),
            [](const SettingResult& a, const SettingResult& b) { return a.seconds < b.seconds; });
  std::vector<SettingResult> best;
  for (const SettingResult& point : points)
    if (best.empty() || point.edited_db > best.back().edited_db) best.push_back(point);
  return best;
}

/// Presets and correctors over all cases, and each case. Adds a chart of the presets.
std::string presets_section(const Bench& bench, std::vector<bench::Chart>& charts) {
  std::string page = "## Presets, all cases\n\n" + head;
  std::vector<SettingResult> presets;
  for (const std::string preset : {"preview", "draft", "standard"})
    for (const std::string corrector : {"none", "harmonic", "scene"}) {
      if (preset == "preview" && corrector != "none") continue;
      presets.push_back(bench.measure(preset + ", " + corrector, "--preset " + preset + " --corrector " + corrector));
      page += row(presets.back());
    }
  page += "\n## Each case at standard\n\n" + bench.cases() + "\n## The two small cases\n\n" + head;
  for (const std::string preset : {"draft", "standard", "paper"})
    page += row(bench.measure(preset + ", scene", "--small --preset " + preset + " --corrector scene"));
  charts.push_back({"Presets, all cases",
                    "seconds",
                    "edited region, dB",
                    {series("presets", front(presets))},
                    bench::Scale::logarithmic,
                    bench::Scale::linear});
  return page;
}

/// One knob turned, all else as in `draft`.
std::vector<SettingResult> turn(const Bench& bench, const Knob& knob) {
  std::vector<SettingResult> points;
  const std::string draft = "--small --preset draft";
  for (const std::string& value : knob.values) {
    const std::string corrector = knob.flag == "--corrector" ? " " : " --corrector scene ";
    points.push_back(bench.measure(knob.name + " " + value, draft + corrector + knob.flag + " " + value));
  }
  if (knob.name == "corrector")
    points.push_back(bench.measure("whole picture for a mask", draft + " --corrector scene --whole-picture"));
  return points;
}

/// Each knob, and the settings that no other one beats. Adds a chart of each.
std::string knobs_section(const Bench& bench, std::vector<bench::Chart>& charts) {
  std::string page =
      "\n## Each knob alone\n\nThe small cases, preset `draft`, corrector `scene` but where it says otherwise.\n";
  std::vector<SettingResult> all;
  bench::Chart by_knob{"Each knob alone",         "seconds",           "edited region, dB", {},
                       bench::Scale::logarithmic, bench::Scale::linear};
  for (const Knob& knob : knobs()) {
    const std::vector<SettingResult> points = turn(bench, knob);
    page += "\n### " + knob.name + "\n\n" + head;
    for (const SettingResult& point : points) page += row(point);
    const bool has_scale = knob.name != "corrector" && knob.name != "interpolation";
    if (has_scale) by_knob.series.push_back(series(knob.name, points));
    all.insert(all.end(), points.begin(), points.end());
  }
  const std::vector<SettingResult> best = front(all);
  page += "\n## The front\n\nSettings above that no other one beats in both time and quality.\n\n" + head;
  for (const SettingResult& point : best) page += row(point);
  charts.push_back(by_knob);
  charts.push_back({"The front",
                    "seconds",
                    "edited region, dB",
                    {series("best of all knobs", best)},
                    bench::Scale::logarithmic,
                    bench::Scale::linear});
  return page;
}

/// Intervals where a drag turns, and where it is long, on a capture.
std::string intervals_section(const Bench& bench) {
  const std::array<std::string, 5> numbers{"1", "2", "5", "10", "20"};
  std::string page =
      "\n## Intervals of a drag that turns\n\nThe case `arm`, preset `draft`, corrector `scene`: both "
      "interpolations.\n\n" +
      head;
  for (const std::string interpolation : {"paper", "rigid"})
    for (const std::string& intervals : numbers)
      page += row(
          bench.measure(intervals + ", " + interpolation, "--case arm --preset draft --corrector scene --intervals " +
                                                              intervals + " --interpolation " + interpolation));
  page +=
      "\n## Intervals on a capture\n\nThe fox's ear, preset `draft`, corrector `scene`: there and back, judged at "
      "cameras between those of the\ncapture; `arrived` is the part of the drag that the half-way scene shows.\n\n"
      "| intervals" +
      trip_head;
  for (const std::string& intervals : numbers)
    page += bench.trip(intervals, "--preset draft --corrector scene --intervals " + intervals);
  page += "\n### What each preset does there\n\n| preset" + trip_head;
  for (const std::string preset : {"preview", "draft", "standard"})
    page += bench.trip(preset, "--preset " + preset + " --corrector scene");
  return page;
}

void write_docs(const Bench& bench, const path& folder) {
  std::vector<bench::Chart> charts;
  std::string page =
      "# What speed costs in quality\n\n"
      "Made by `build/release/bench/tradeoff build/release/splatdrag docs out/tradeoff`. Edits whose right result is\n"
      "known, judged at cameras that they have not seen: PSNR and SSIM of the edited region, PSNR of what was vacated\n"
      "where that has a texture, and outside; seconds of an edit; means over the cases.\n\n"
      "![](tradeoff.svg)\n\n";
  page += presets_section(bench, charts);
  page += knobs_section(bench, charts);
  page += intervals_section(bench);
  std::rotate(charts.begin(), charts.begin() + 1, charts.end());  // the presets' comes last
  std::ofstream(folder / "tradeoff.md") << page;
  std::ofstream(folder / "tradeoff.svg") << bench::to_svg(charts);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: tradeoff SPLATDRAG FOLDER RESULTS\n");
    return 2;
  }
  try {
    write_docs(Bench(argv[1], argv[3]), argv[2]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
  return 0;
}
