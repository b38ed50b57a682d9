// What a running edit writes down about itself: kept in its job's record, read back into its status, and by the run
// that goes on with it after a restart. Not for clients.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/edit_status.h"

namespace proto {

/// The fields are those of EditStatus.
struct EditRecord {
  std::string stage;
  double progress = 0;
  std::optional<double> eta_seconds;
  int interval = 0, intervals = 0;
  int iteration = 0;
  std::optional<double> loss;
  std::vector<FinishedInterval> finished_intervals;
  std::vector<HandleCount> handles;
  std::optional<EditRequest> request;
  std::vector<StageSeconds> timings;
  std::optional<GaussianCounts> gaussians;
  std::vector<std::string> warnings;
  std::optional<int> result_version;
  std::string simd;
};

[[nodiscard]] std::string to_json(const EditRecord& record);
/// errors  corrupt_data: the text is not what to_json() writes
[[nodiscard]] Result<EditRecord> parse_edit_record(std::string_view text);

}  // namespace proto
