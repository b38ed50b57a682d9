#include "server/cli/bench_report.h"

#include <fstream>
#include <optional>
#include <span>
#include <string>

#include "engine/core/atomic_file.h"
#include "proto/json_text.h"

namespace server::cli {
namespace {

namespace captures = engine::captures;
namespace evaluate = engine::evaluate;
using nlohmann::ordered_json;

ordered_json encode(const std::optional<double>& number) { return number ? ordered_json(*number) : ordered_json(); }

std::optional<double> number_or_null(const ordered_json& from) {
  return from.is_null() ? std::nullopt : std::optional(from.get<double>());
}

ordered_json encode(const evaluate::RegionQuality& likeness) {
  return {{"psnr_db", likeness.psnr_db},
          {"ssim", likeness.ssim},
          {"detail", encode(likeness.detail)},
          {"pixels", likeness.pixels}};
}

ordered_json encode(const evaluate::Quality& quality) {
  return {{"edited", encode(quality.edited)},
          {"vacated", encode(quality.vacated)},
          {"arrived", encode(quality.arrived)},
          {"outside", encode(quality.outside)},
          {"miss", quality.miss}};
}

ordered_json encode(const std::vector<engine::edit::StageTime>& times) {
  ordered_json stages = ordered_json::object();
  for (const auto& time : times) stages[std::string(name_of(time.stage))] = time.seconds;
  return stages;
}

void decode(const ordered_json& from, evaluate::RegionQuality& likeness) {
  from.at("psnr_db").get_to(likeness.psnr_db);
  from.at("ssim").get_to(likeness.ssim);
  likeness.detail = number_or_null(from.at("detail"));
  from.at("pixels").get_to(likeness.pixels);
}

void decode(const ordered_json& from, evaluate::Quality& quality) {
  decode(from.at("edited"), quality.edited);
  decode(from.at("vacated"), quality.vacated);
  decode(from.at("arrived"), quality.arrived);
  decode(from.at("outside"), quality.outside);
  from.at("miss").get_to(quality.miss);
}

}  // namespace

ordered_json encode(const evaluate::Trial& trial) {
  const evaluate::Agreement& agreement = trial.corrected_views;
  return {{"case", trial.name},
          {"what", trial.what},
          {"corrector", trial.corrector},
          {"textured", trial.textured},
          {"gaussians", trial.gaussians},
          {"part", trial.part},
          {"seeds", trial.seeds},
          {"uncovered", trial.uncovered},
          {"open", trial.open},
          {"intervals", trial.intervals},
          {"untouched", encode(trial.untouched)},
          {"result", encode(trial.result)},
          {"untouched_lpips", encode(trial.untouched_lpips)},
          {"lpips", encode(trial.lpips)},
          {"corrected_views_agree", {{"psnr_db", agreement.psnr_db}, {"pixels", agreement.pixels}}},
          {"seconds", trial.seconds},
          {"stages", encode(trial.stages)},
          {"peak_memory_bytes", trial.peak_memory_bytes},
          {"warnings", trial.warnings}};
}

ordered_json encode(const evaluate::TripTrial& trial) {
  return {{"request", trial.request},       {"corrector", trial.corrector},     {"arrived", trial.arrived},
          {"inside", encode(trial.inside)}, {"outside", encode(trial.outside)}, {"zero_drag", encode(trial.zero_drag)},
          {"cameras", trial.cameras},       {"seconds", trial.seconds}};
}

void decode(const ordered_json& from, evaluate::Trial& trial) {
  from.at("case").get_to(trial.name);
  from.at("what").get_to(trial.what);
  from.at("corrector").get_to(trial.corrector);
  from.at("textured").get_to(trial.textured);
  from.at("gaussians").get_to(trial.gaussians);
  from.at("part").get_to(trial.part);
  from.at("seeds").get_to(trial.seeds);
  from.at("uncovered").get_to(trial.uncovered);
  from.at("open").get_to(trial.open);
  from.at("intervals").get_to(trial.intervals);
  decode(from.at("untouched"), trial.untouched);
  decode(from.at("result"), trial.result);
  trial.untouched_lpips = number_or_null(from.at("untouched_lpips"));
  trial.lpips = number_or_null(from.at("lpips"));
  from.at("corrected_views_agree").at("psnr_db").get_to(trial.corrected_views.psnr_db);
  from.at("corrected_views_agree").at("pixels").get_to(trial.corrected_views.pixels);
  from.at("seconds").get_to(trial.seconds);
  for (const auto& [name, seconds] : from.at("stages").items())
    if (const auto stage = engine::value_named<engine::edit::Stage>(name))
      trial.stages.push_back({*stage, seconds.template get<double>()});
  from.at("peak_memory_bytes").get_to(trial.peak_memory_bytes);
  from.at("warnings").get_to(trial.warnings);
}

void decode(const ordered_json& from, evaluate::TripTrial& trial) {
  from.at("request").get_to(trial.request);
  from.at("corrector").get_to(trial.corrector);
  from.at("arrived").get_to(trial.arrived);
  decode(from.at("inside"), trial.inside);
  decode(from.at("outside"), trial.outside);
  decode(from.at("zero_drag"), trial.zero_drag);
  from.at("cameras").get_to(trial.cameras);
  from.at("seconds").get_to(trial.seconds);
}

/// The columns of every trial, then those of captured cases. Derived figures are for readers; decode() has no need of
/// them.
ordered_json encode(const captures::CaptureTrial& trial) {
  ordered_json out = encode(trial.trial);
  out["test"] = trial.is_test;
  out["by"] = trial.by;
  out["said"] = trial.said;
  out["deformed"] = encode(trial.deformed);
  out["ceiling"] = encode(trial.ceiling);
  out["gain_db"] = trial.gain_db();
  out["share_of_ceiling"] = encode(trial.share_of_ceiling());
  out["beyond_db"] = {{"untouched", trial.untouched_beyond_db},
                      {"deformed", trial.deformed_beyond_db},
                      {"result", trial.result_beyond_db},
                      {"ceiling", trial.ceiling_beyond_db}};
  out["recall"] = trial.match.recall;
  out["precision"] = trial.match.precision;
  out["shown_recall"] = trial.shown.recall;
  out["shown_precision"] = trial.shown.precision;
  out["fit_seconds"] = trial.fit_seconds;
  return out;
}

void decode(const ordered_json& from, captures::CaptureTrial& trial) {
  decode(from, trial.trial);
  from.at("test").get_to(trial.is_test);
  from.at("by").get_to(trial.by);
  from.at("said").get_to(trial.said);
  decode(from.at("deformed"), trial.deformed);
  decode(from.at("ceiling"), trial.ceiling);
  const ordered_json& beyond = from.at("beyond_db");
  beyond.at("untouched").get_to(trial.untouched_beyond_db);
  beyond.at("deformed").get_to(trial.deformed_beyond_db);
  beyond.at("result").get_to(trial.result_beyond_db);
  beyond.at("ceiling").get_to(trial.ceiling_beyond_db);
  from.at("recall").get_to(trial.match.recall);
  from.at("precision").get_to(trial.match.precision);
  from.at("shown_recall").get_to(trial.shown.recall);
  from.at("shown_precision").get_to(trial.shown.precision);
  from.at("fit_seconds").get_to(trial.fit_seconds);
}

template <class ResultType>
std::optional<ResultType> cached_result(const std::filesystem::path& file) {
  std::ifstream in(file);
  const ordered_json json = ordered_json::parse(in, nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) return std::nullopt;
  try {
    ResultType found;
    decode(json, found);
    return found;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;  // not what we wrote
  }
}
template std::optional<evaluate::Trial> cached_result(const std::filesystem::path& file);
template std::optional<evaluate::TripTrial> cached_result(const std::filesystem::path& file);
template std::optional<captures::CaptureTrial> cached_result(const std::filesystem::path& file);

engine::Result<void> write_json(const std::filesystem::path& file, const ordered_json& what) {
  const std::string text = proto::pretty(what) + "\n";
  return engine::write_file(file, std::as_bytes(std::span(text)));
}

}  // namespace server::cli
