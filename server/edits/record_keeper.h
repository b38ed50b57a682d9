// The record of a running edit: what it tells its readers, and when.
#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "engine/edit/edit.h"
#include "proto/edit_record.h"
#include "server/edits/stages.h"

namespace server::edits {

/// Keeps the record up to date and publishes it: on every change of stage or interval, otherwise at most ten times a
/// second. Between two publications not a byte changes. For one thread.
class RecordKeeper {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;
  using Publish = std::function<void(std::string)>;  ///< Takes the record as JSON.

  /// record   as an earlier run left it, or a new one; times go on from there
  RecordKeeper(proto::EditRecord record, Publish publish, Clock clock = std::chrono::steady_clock::now);

  /// To be changed freely; readers see it after the next publish().
  [[nodiscard]] proto::EditRecord& record() { return record_; }
  /// From now on time counts for this stage.
  void enter(JobStage stage);
  /// What the job will do after the edit takes so long: it joins the time that is left.
  void expect_after(double seconds) { after_seconds_ = seconds; }
  /// News of the engine. `progress` of the record never falls, and stays below 1 until finish().
  void advance(const engine::edit::Progress& progress);
  /// Puts the interval in, in place of an earlier record of it.
  void add(proto::FinishedInterval finished);
  void warn(const std::string& warning);  ///< Once for each sentence.
  /// Time that has counted for stages so far, those of earlier runs included, seconds.
  [[nodiscard]] double seconds();
  void forget_time();  ///< From now on it counts anew.
  void publish();
  void finish();  ///< All is done: publishes it.

 private:
  using TimePoint = std::chrono::steady_clock::time_point;

  void count_time();  ///< For the present stage, up to now.
  void leave_stage();

  proto::EditRecord record_;
  Publish publish_;
  Clock clock_;
  TimePoint since_, published_;
  double after_seconds_ = 0;
};

}  // namespace server::edits
