// Results of `splatdrag bench-edit` as JSON: in bench.json, captures.json and trips.json, and in a cache from one run
// to the next.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "engine/captures/capture_trial.h"
#include "engine/core/result.h"
#include "engine/evaluate/trial.h"
#include "engine/evaluate/trip_trial.h"

namespace server::cli {

/// The JSON of a result.
[[nodiscard]] nlohmann::ordered_json encode(const engine::evaluate::Trial& trial);
[[nodiscard]] nlohmann::ordered_json encode(const engine::evaluate::TripTrial& trial);
[[nodiscard]] nlohmann::ordered_json encode(const engine::captures::CaptureTrial& trial);

/// The reverse of encode(). Throw what nlohmann::json does where a field is missing or of another type.
void decode(const nlohmann::ordered_json& from, engine::evaluate::Trial& trial);
void decode(const nlohmann::ordered_json& from, engine::evaluate::TripTrial& trial);
void decode(const nlohmann::ordered_json& from, engine::captures::CaptureTrial& trial);

/// The result that the file holds; nothing if it is not there, damaged or of another form.
template <class ResultType>
[[nodiscard]] std::optional<ResultType> cached_result(const std::filesystem::path& file);
extern template std::optional<engine::evaluate::Trial> cached_result(const std::filesystem::path& file);
extern template std::optional<engine::evaluate::TripTrial> cached_result(const std::filesystem::path& file);
extern template std::optional<engine::captures::CaptureTrial> cached_result(const std::filesystem::path& file);

/// Writes indented JSON with a line's end.
///   errors  those of engine::write_file()
[[nodiscard]] engine::Result<void> write_json(const std::filesystem::path& file, const nlohmann::ordered_json& what);

/// The result that an earlier run left in the file, or else a new one, which is then written there.
///   errors  those of `find` and of write_json()
template <class ResultType>
[[nodiscard]] engine::Result<ResultType> cached_or_new(const std::filesystem::path& file,
                                                       const std::function<engine::Result<ResultType>()>& find) {
  if (auto cached = cached_result<ResultType>(file)) return std::move(*cached);
  auto found = find();
  if (!found) return found;
  if (auto written = write_json(file, encode(*found)); !written) return engine::propagate(written);
  return found;
}

}  // namespace server::cli
