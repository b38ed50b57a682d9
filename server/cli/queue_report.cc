#include "server/cli/queue_report.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

namespace server::cli {
namespace {

using edits::EditAtHand;
using nlohmann::ordered_json;
using Row = std::vector<std::string>;

/// Columns as wide as what stands in them; nothing that would move a terminal's cursor.
std::string as_table(std::vector<Row> rows) {
  std::vector<std::size_t> widths;
  for (Row& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) {
      std::replace_if(
          row[i].begin(), row[i].end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
      widths.resize(std::max(widths.size(), i + 1));
      widths[i] = std::max(widths[i], row[i].size());
    }
  std::string text;
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) line += row[i] + std::string(widths[i] - row[i].size() + 2, ' ');
    text += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
  }
  return text;
}

std::string or_dash(const std::string& text) { return text.empty() ? "-" : text; }
std::string or_dash(const std::optional<double>& seconds) { return seconds ? short_time(*seconds) : "-"; }

std::string lease_of(const EditAtHand::Claim& claim) {
  if (!claim.lease_left) return "-";
  return *claim.lease_left < 0 ? "over" : short_time(*claim.lease_left);
}

/// What a reader has to know of claims in a file.
std::string remark(const edits::QueueLook& look) {
  const bool held = std::ranges::any_of(look.edits, [](const EditAtHand& edit) { return edit.claim.has_value(); });
  if (!held || look.in_use != false) return {};
  return "no service is at work here: whoever had these edits has ended, and the next one takes them up\n";
}

ordered_json rounded(const std::optional<double>& seconds) {
  return seconds ? ordered_json(std::round(1000 * *seconds) / 1000) : ordered_json();
}
ordered_json or_null(const std::string& text) { return text.empty() ? ordered_json() : ordered_json(text); }
ordered_json in_use(const edits::QueueLook& look) { return look.in_use ? ordered_json(*look.in_use) : ordered_json(); }
std::string text_of(const ordered_json& json) {
  return json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + '\n';
}

}  // namespace

std::string short_time(double seconds) {
  constexpr double minute = 60, hour = 3600, day = 24 * hour;
  const auto in = [&](double unit, const char* name) {
    return std::to_string(std::int64_t(std::llround(seconds / unit))) + " " + name;
  };
  if (std::abs(seconds) < 2 * minute) return in(1, "s");
  if (std::abs(seconds) < 2 * hour) return in(minute, "min");
  return std::abs(seconds) < 2 * day ? in(hour, "h") : in(day, "d");
}

std::string queue_table(const edits::QueueLook& look) {
  if (look.edits.empty()) return "no edit waits or runs\n";
  std::vector<Row> rows{
      {"EDIT", "SCENE", "STATE", "PLACE", "AGE", "TAKES", "WORKED", "INTERVALS", "DEATHS", "TOKEN", "WORKER", "ERROR"}};
  for (const EditAtHand& edit : look.edits)
    rows.push_back({edit.id, edit.scene, edit.state, edit.place > 0 ? std::to_string(edit.place) : "-",
                    short_time(edit.age), or_dash(edit.expected), short_time(edit.worked),
                    std::to_string(edit.finished_intervals),
                    edit.deaths == 0 ? "0" : std::to_string(edit.deaths) + " (" + or_dash(edit.died_at) + ")",
                    or_dash(edit.token), edit.claim ? or_dash(edit.claim->worker) : "-", or_dash(edit.error)});
  return as_table(std::move(rows)) + remark(look);
}

std::string workers_table(const edits::QueueLook& look) {
  std::vector<Row> rows{{"WORKER", "EDIT", "SCENE", "SINCE", "LEASE", "CLAIM", "INTERVALS", "DEATHS"}};
  for (const EditAtHand& edit : look.edits)
    if (edit.claim)
      rows.push_back({or_dash(edit.claim->worker), edit.id, edit.scene, or_dash(edit.claim->since),
                      lease_of(*edit.claim), std::to_string(edit.claim->number),
                      std::to_string(edit.finished_intervals), std::to_string(edit.deaths)});
  if (rows.size() == 1) return "no worker has an edit\n";
  return as_table(std::move(rows)) + remark(look);
}

std::string queue_json(const edits::QueueLook& look) {
  ordered_json all = ordered_json::array();
  for (const EditAtHand& edit : look.edits) {
    ordered_json claim;
    if (edit.claim)
      claim = {{"worker", or_null(edit.claim->worker)},
               {"number", edit.claim->number},
               {"since_seconds", rounded(edit.claim->since)},
               {"lease_seconds", rounded(edit.claim->lease_left)}};
    all.push_back({{"id", edit.id},
                   {"scene", edit.scene},
                   {"state", edit.state},
                   {"token", or_null(edit.token)},
                   {"place", edit.place > 0 ? ordered_json(edit.place) : ordered_json()},
                   {"age_seconds", rounded(edit.age)},
                   {"expected_seconds", rounded(edit.expected)},
                   {"worked_seconds", rounded(edit.worked)},
                   {"finished_intervals", edit.finished_intervals},
                   {"deaths", edit.deaths},
                   {"died_at", or_null(edit.died_at)},
                   {"claim", std::move(claim)},
                   {"error", or_null(edit.error)}});
  }
  return text_of({{"edits", std::move(all)}, {"in_use", in_use(look)}});
}

std::string workers_json(const edits::QueueLook& look) {
  ordered_json all = ordered_json::array();
  for (const EditAtHand& edit : look.edits)
    if (edit.claim)
      all.push_back({{"worker", or_null(edit.claim->worker)},
                     {"edit", edit.id},
                     {"scene", edit.scene},
                     {"claim", edit.claim->number},
                     {"since_seconds", rounded(edit.claim->since)},
                     {"lease_seconds", rounded(edit.claim->lease_left)},
                     {"deaths", edit.deaths},
                     {"finished_intervals", edit.finished_intervals}});
  return text_of({{"workers", std::move(all)}, {"in_use", in_use(look)}});
}

}  // namespace server::cli
