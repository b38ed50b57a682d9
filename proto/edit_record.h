// The record of a running edit, which is kept with its job. The edit's status is made from it, and whoever goes on with
// the edit after a restart reads it. Not for clients.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/edit_status.h"

namespace proto {

/// Fields mean what those of the same name in EditStatus mean.
struct EditRecord {
  std::string stage;
  double progress = 0;
  std::optional<double> eta_seconds;
  int interval = 0, intervals = 0;
  int iteration = 0;
  std::optional<double> loss;
  std::vector<FinishedInterval> finished_intervals;
  std::vector<HandleCount> handles;
  std::vector<Part> parts;
  std::optional<EditRequest> request;
  std::vector<StageSeconds> timings;
  std::optional<GaussianCounts> gaussians;
  std::vector<Uncovered> uncovered;
  std::vector<std::string> warnings;
  std::optional<int> result_version;
  std::string simd;
};

/// The record as JSON text.
[[nodiscard]] std::string to_json(const EditRecord& record);
/// The reverse of to_json().
///   errors  corrupt_data: the text is not what to_json() writes
[[nodiscard]] Result<EditRecord> parse_edit_record(std::string_view text);

}  // namespace proto
