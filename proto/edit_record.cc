#include "proto/edit_record.h"

#include <exception>
#include <nlohmann/json.hpp>

namespace proto {
namespace {

using nlohmann::ordered_json;

template <class T>
ordered_json or_null(const std::optional<T>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

template <class T>
std::optional<T> optional_at(const ordered_json& object, const char* name) {
  const ordered_json& value = object.at(name);
  if (value.is_null()) return std::nullopt;
  return value.get<T>();
}

ordered_json encode(const FinishedInterval& finished) {
  ordered_json renders = ordered_json::array();
  for (const IntervalRender& render : finished.renders)
    renders.push_back({{"view", render.view}, {"stages", render.stages}});
  return {{"interval", finished.interval},
          {"seconds", finished.seconds},
          {"positions", finished.positions},
          {"loss", or_null(finished.loss)},
          {"renders", std::move(renders)}};
}

FinishedInterval decode_interval(const ordered_json& object) {
  FinishedInterval finished;
  finished.interval = object.at("interval").get<int>();
  finished.seconds = object.at("seconds").get<double>();
  finished.positions = object.at("positions").get<std::vector<Point>>();
  finished.loss = optional_at<double>(object, "loss");
  for (const ordered_json& render : object.at("renders"))
    finished.renders.push_back(
        {render.at("view").get<std::string>(), render.at("stages").get<std::vector<std::string>>()});
  return finished;
}

/// Requests are kept without their selection, which may be long and is kept once, with the job. A removal may have
/// nothing else that says what goes, and would be refused: any selection stands in for its own while it is read.
EditRequest decode_request(ordered_json object) {
  const bool lacks_handles = object.at("handles").empty();
  if (lacks_handles) object["selection"] = ordered_json::array({{{"invert", true}}});
  EditRequest request = parse_edit_request(object.dump()).value();
  if (lacks_handles) request.selection.reset();
  return request;
}

Uncovered decode_uncovered(const ordered_json& list) {
  Uncovered uncovered{list.at(0).get<std::string>(), list.at(1).get<double>(), list.at(2).get<double>(), {}};
  if (!list.at(3).is_null()) uncovered.open_box = list.at(3).get<std::array<double, 4>>();
  return uncovered;
}

ordered_json encode(const std::optional<GaussianCounts>& counts) {
  if (!counts) return nullptr;
  return {counts->input,      counts->output, counts->removed, counts->copies,
          counts->changeable, counts->crumbs, counts->relit};
}

EditRecord decode(const ordered_json& object) {
  EditRecord record;
  record.stage = object.at("stage").get<std::string>();
  record.progress = object.at("progress").get<double>();
  record.eta_seconds = optional_at<double>(object, "eta_seconds");
  record.interval = object.at("interval").get<int>();
  record.intervals = object.at("intervals").get<int>();
  record.iteration = object.at("iteration").get<int>();
  record.loss = optional_at<double>(object, "loss");
  for (const ordered_json& finished : object.at("finished_intervals"))
    record.finished_intervals.push_back(decode_interval(finished));
  for (const ordered_json& count : object.at("handles")) record.handles.push_back({count.get<std::size_t>()});
  if (const auto parts = object.find("parts"); parts != object.end())  // records of earlier versions have none
    for (const ordered_json& part : *parts)
      record.parts.push_back({part.at(0).get<int>(), part.at(1).get<std::string>(), part.at(2).get<std::string>(),
                              part.size() > 3 ? part.at(3).get<double>() : 0});  // of earlier versions have three
  if (const ordered_json& request = object.at("request"); !request.is_null()) record.request = decode_request(request);
  for (const ordered_json& timing : object.at("timings"))
    record.timings.push_back({timing.at(0).get<std::string>(), timing.at(1).get<double>()});
  if (const auto n = optional_at<std::vector<std::size_t>>(object, "gaussians"))
    record.gaussians = {n->at(0),
                        n->at(1),
                        n->at(2),
                        n->at(3),
                        n->at(4),
                        n->size() > 5 ? n->at(5) : 0,                      // records of earlier versions have five,
                        n->size() > 6 ? n->at(6) : 0};                     // or six
  if (const auto views = object.find("uncovered"); views != object.end())  // records of earlier versions have none
    for (const ordered_json& view : *views) record.uncovered.push_back(decode_uncovered(view));
  record.warnings = object.at("warnings").get<std::vector<std::string>>();
  record.result_version = optional_at<int>(object, "result_version");
  record.simd = object.at("simd").get<std::string>();
  return record;
}

}  // namespace

std::string to_json(const EditRecord& record) {
  ordered_json finished = ordered_json::array(), handles = ordered_json::array(), timings = ordered_json::array(),
               parts = ordered_json::array(), uncovered = ordered_json::array();
  for (const FinishedInterval& interval : record.finished_intervals) finished.push_back(encode(interval));
  for (const HandleCount& handle : record.handles) handles.push_back(handle.gaussians);
  for (const Part& part : record.parts) parts.push_back({part.group, part.how, part.why, part.settled});
  for (const Uncovered& view : record.uncovered)
    uncovered.push_back({view.view, view.area, view.open, or_null(view.open_box)});
  for (const StageSeconds& timing : record.timings) timings.push_back({timing.stage, timing.seconds});
  ordered_json out{{"stage", record.stage},
                   {"progress", record.progress},
                   {"eta_seconds", or_null(record.eta_seconds)},
                   {"interval", record.interval},
                   {"intervals", record.intervals},
                   {"iteration", record.iteration},
                   {"loss", or_null(record.loss)},
                   {"finished_intervals", std::move(finished)},
                   {"handles", std::move(handles)},
                   {"parts", std::move(parts)},
                   {"request", nullptr},
                   {"timings", std::move(timings)},
                   {"gaussians", encode(record.gaussians)},
                   {"uncovered", std::move(uncovered)},
                   {"warnings", record.warnings},
                   {"result_version", or_null(record.result_version)},
                   {"simd", record.simd}};
  if (record.request) out["request"] = ordered_json::parse(to_json(*record.request));
  return out.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

Result<EditRecord> parse_edit_record(std::string_view text) {
  try {
    return decode(ordered_json::parse(text));
  } catch (const std::exception& e) {
    return engine::fail(engine::ErrorCode::corrupt_data, std::string("an edit's record cannot be read: ") + e.what());
  }
}

}  // namespace proto
