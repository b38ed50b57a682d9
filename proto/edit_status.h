// What the service says about edits: their state, their estimate, their preview. Structs here, JSON in the .cc.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "proto/edit_request.h"

namespace proto {

/// How a group of handles moves what is theirs, where that is as an elastic body.
struct Part {
  int group = 0;
  std::string how;     ///< "one_piece", "free", "held", "drawn_out" or "continued".
  std::string why;     ///< For people.
  double settled = 0;  ///< So far from where its handles ask it is set down on what it stands on, world units.
};

/// One picture of an interval, under /v1/edits/{id}/intervals/{u}/renders/{k}.
struct IntervalRender {
  std::string view;
  std::vector<std::string> stages;  ///< Which pictures there are of the view: "before", "deformed", ...
};

/// An interval whose checkpoint is on disk.
struct FinishedInterval {
  int interval = 0;              ///< Its number, from 1.
  double seconds = 0;            ///< Time that it took.
  std::vector<Point> positions;  ///< Where the handles are after it, world units.
  std::optional<double> loss;    ///< Mean over the views of the last epoch; none without optimisation.
  std::vector<IntervalRender> renders;
};

/// How much a handle of the request holds.
struct HandleCount {
  std::size_t gaussians = 0;  ///< Gaussians that follow the handle.
};

/// Time that a stage of the edit has taken.
struct StageSeconds {
  std::string stage;   ///< Name of an engine::edit::Stage.
  double seconds = 0;  ///< All intervals together.
};

/// Gaussians of an edit: in its input and its output, rows removed and new rows (`copies`), members of M
/// (`changeable`); rows that the selection had left out, and that went along or away (`crumbs`); rows
/// that the part's shadow has left or reached (`relit`).
struct GaussianCounts {
  std::size_t input = 0, output = 0, removed = 0, copies = 0, changeable = 0, crumbs = 0, relit = 0;
};

/// What one view showed of the place that a moved part has left. Fractions of the picture.
struct Uncovered {
  std::string view;
  double area = 0;  ///< What the part has left.
  double open = 0;  ///< What of that no camera has seen, and no surface goes on to.
  std::optional<std::array<double, 4>>
      open_box;  ///< Left, top, right and bottom of the box around it, if there is some.
};

/// Everything about one edit. Times are RFC 3339, UTC, milliseconds.
struct EditStatus {
  std::string id;
  std::string scene;
  int version = 0;    ///< Version that it edits.
  std::string state;  ///< "queued", "running", "stop_requested", "cancel_requested", "succeeded", "failed", "cancelled"
  bool stopped_early = false;
  std::optional<int> queue_position;  ///< Place among the edits that wait; 1 is the next.
  std::string stage;                  ///< "assign", "views", "deform", "mask", ...; empty before the edit starts.
  double progress = 0;                ///< 0 to 1, never falls.
  std::optional<double> eta_seconds;  ///< Time left of a running edit, as estimated at its last report.
  int interval = 0, intervals = 0;    ///< Number of the interval in work, and T; 0 before it is known.
  int iteration = 0;                  ///< Iterations done in the interval in work; 0 while it does not optimise.
  int iterations = 0;                 ///< Iterations of each interval, all corrections together; 0: none.
  std::optional<double> loss;         ///< Loss of the last iteration reported, while it optimises.
  std::vector<FinishedInterval> finished_intervals;
  std::vector<HandleCount> handles;
  std::vector<Part> parts;
  EditRequest request;  ///< As the client sent it; with every parameter filled in once the edit has started.
  std::vector<StageSeconds> timings;
  std::optional<GaussianCounts> gaussians;  ///< Only of an edit that succeeded.
  std::vector<Uncovered> uncovered;         ///< By a move that was repaired: views that show what the part has left.
  std::vector<std::string> warnings;
  std::optional<int> result_version;
  std::optional<engine::Error> error;
  std::string created;
  std::optional<std::string> started, ended;
  std::string simd;  ///< Instruction set that the edit ran on; empty before it starts.
};

/// What an edit is expected to cost.
struct EditEstimate {
  std::vector<HandleCount> handles;
  std::size_t views = 0;
  int intervals = 0;
  std::vector<Part> parts;
  double seconds = 0;              ///< Estimated time.
  std::uint64_t memory_bytes = 0;  ///< Estimated peak beside the scene itself.
  EditRequest request;             ///< The request with every parameter filled in.
  std::vector<std::string> warnings;
};

/// A deformation that was made at once, as a version that lives for a while.
struct Preview {
  std::string scene;
  std::string version;  ///< "p000001": may be rendered and picked like any version, until it expires.
  int parent = 0;
  std::string expires;
  std::vector<HandleCount> handles;
  std::vector<Point> positions;  ///< Where the handles are after the whole drag, world units.
  int intervals = 0;
  std::vector<Part> parts;
  GaussianCounts gaussians;
  double seconds = 0;  ///< Time that the preview took.
  std::vector<std::string> warnings;
};

[[nodiscard]] std::string to_json(const EditStatus& status);
[[nodiscard]] std::string to_json(const std::vector<EditStatus>& edits);  ///< {"edits": [...]}
[[nodiscard]] std::string to_json(const EditEstimate& estimate);
[[nodiscard]] std::string to_json(const Preview& preview);

}  // namespace proto
