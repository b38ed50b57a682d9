// What `splatdrag bench-edit` found, as JSON: in bench.json and trips.json, and kept from one run to the next.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "engine/core/result.h"
#include "engine/evaluate/trial.h"
#include "engine/evaluate/trip_trial.h"

namespace server::cli {

[[nodiscard]] nlohmann::ordered_json encode(const engine::evaluate::Trial& trial);
[[nodiscard]] nlohmann::ordered_json encode(const engine::evaluate::TripTrial& trial);

/// The reverse. Throw what nlohmann::json does where a field is missing or of another type.
void decode(const nlohmann::ordered_json& from, engine::evaluate::Trial& trial);
void decode(const nlohmann::ordered_json& from, engine::evaluate::TripTrial& trial);

/// A result that the file holds whole, if it does.
template <class Found>
[[nodiscard]] std::optional<Found> kept_result(const std::filesystem::path& file);
extern template std::optional<engine::evaluate::Trial> kept_result(const std::filesystem::path& file);
extern template std::optional<engine::evaluate::TripTrial> kept_result(const std::filesystem::path& file);

/// Writes indented JSON with a line's end.
///   errors  those of engine::write_file()
[[nodiscard]] engine::Result<void> write_json(const std::filesystem::path& file, const nlohmann::ordered_json& what);

/// A result: kept in the file by an earlier run, or new and then kept there.
///   errors  those of `find` and of write_json()
template <class Found>
[[nodiscard]] engine::Result<Found> kept_or(const std::filesystem::path& file,
                                            const std::function<engine::Result<Found>()>& find) {
  if (auto kept = kept_result<Found>(file)) return std::move(*kept);
  auto found = find();
  if (!found) return found;
  if (auto kept = write_json(file, encode(*found)); !kept) return engine::propagate(kept);
  return found;
}

}  // namespace server::cli
