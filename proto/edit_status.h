// What the service says about edits: their state, their estimate, their preview. Structs here, JSON in the .cc.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "proto/edit_request.h"

namespace proto {

/// One picture of an interval, under /v1/edits/{id}/intervals/{u}/renders/{k}.
struct IntervalRender {
  std::string view;
  std::vector<std::string> stages;  ///< "before", "deformed", ...: those there are.
};

/// An interval whose checkpoint is on disk.
struct FinishedInterval {
  int interval = 0;              ///< From 1.
  double seconds = 0;            ///< It took.
  std::vector<Point> positions;  ///< Of the handles after it, world units.
  std::optional<double> loss;    ///< Mean over the views of the last epoch; none without optimisation.
  std::vector<IntervalRender> renders;
};

struct HandleCount {
  std::size_t gaussians = 0;  ///< That it holds.
};

struct StageSeconds {
  std::string stage;
  double seconds = 0;
};

struct GaussianCounts {
  std::size_t input = 0, output = 0, removed = 0, copies = 0, changeable = 0;
};

/// Everything about one edit. Times are RFC 3339, UTC, milliseconds.
struct EditStatus {
  std::string id;
  std::string scene;
  int version = 0;    ///< That it edits.
  std::string state;  ///< "queued", "running", "stop_requested", "cancel_requested", "succeeded", "failed", "cancelled"
  bool stopped_early = false;
  std::optional<int> queue_position;  ///< 1: next.
  std::string stage;                  ///< "assign", "views", "deform", "mask", ...; empty before it starts.
  double progress = 0;                ///< 0 to 1, never falls.
  std::optional<double> eta_seconds;  ///< Of the running edit, as of its last news.
  int interval = 0, intervals = 0;    ///< In work, of T; 0 before they are known.
  int iteration = 0;           ///< Done of the optimisation of the interval in work; 0 while it does not optimise.
  int iterations = 0;          ///< Of each interval, all corrections together; 0: nothing is optimised.
  std::optional<double> loss;  ///< Of the last iteration, as of its last news, while it optimises.
  std::vector<FinishedInterval> finished_intervals;
  std::vector<HandleCount> handles;
  EditRequest request;  ///< As asked; with every parameter filled in once the edit has started.
  std::vector<StageSeconds> timings;
  std::optional<GaussianCounts> gaussians;  ///< Of one that succeeded.
  std::vector<std::string> warnings;
  std::optional<int> result_version;
  std::optional<engine::Error> error;
  std::string created;
  std::optional<std::string> started, ended;
  std::string simd;  ///< Instruction set it ran on; empty before it starts.
};

struct EditEstimate {
  std::vector<HandleCount> handles;
  std::size_t views = 0;
  int intervals = 0;
  double seconds = 0;              ///< About.
  std::uint64_t memory_bytes = 0;  ///< Beside the scene itself, about.
  EditRequest request;             ///< With every parameter filled in.
  std::vector<std::string> warnings;
};

struct Preview {
  std::string scene;
  std::string version;  ///< "p000001": may be rendered and picked like any version, until it expires.
  int parent = 0;
  std::string expires;
  std::vector<HandleCount> handles;
  std::vector<Point> positions;  ///< Of the handles after the whole drag.
  int intervals = 0;
  GaussianCounts gaussians;
  double seconds = 0;  ///< It took.
  std::vector<std::string> warnings;
};

[[nodiscard]] std::string to_json(const EditStatus& status);
[[nodiscard]] std::string to_json(const std::vector<EditStatus>& edits);  ///< {"edits": [...]}
[[nodiscard]] std::string to_json(const EditEstimate& estimate);
[[nodiscard]] std::string to_json(const Preview& preview);

}  // namespace proto
