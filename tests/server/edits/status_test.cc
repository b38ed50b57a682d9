#include "server/edits/status.h"

#include <gtest/gtest.h>

#include "proto/edit_record.h"

namespace server::edits {
namespace {

using engine::jobs::Job;
using engine::jobs::JobState;

Job at_work(JobState state) {
  proto::EditRecord record;
  record.stage = "optimise";
  record.progress = 0.5;
  record.eta_seconds = 12;
  record.interval = 2;
  record.intervals = 3;
  record.iteration = 7;
  record.loss = 0.25;
  record.finished_intervals.emplace_back().interval = 1;
  Job job;
  job.id = "e000001";
  job.lane = "s000001";
  job.state = state;
  job.finished_intervals = 1;
  job.progress = to_json(record);
  return job;
}

TEST(EditStatus, TellsWhatAnEditIsAtWhileItRuns) {
  const auto status = status_of(at_work(JobState::running));
  EXPECT_EQ(status.stage, "optimise");
  EXPECT_EQ(status.eta_seconds, 12);
  EXPECT_EQ(status.iteration, 7);
  EXPECT_EQ(status.loss, 0.25);
}

TEST(EditStatus, AnEditThatHasMadeWayIsAtNothingAndKeepsWhatItHas) {
  const auto status = status_of(at_work(JobState::queued));
  EXPECT_EQ(status.state, "queued");
  EXPECT_EQ(status.stage, "");
  EXPECT_EQ(status.eta_seconds, std::nullopt);
  EXPECT_EQ(status.iteration, 0);
  EXPECT_EQ(status.loss, std::nullopt);
  EXPECT_EQ(status.progress, 0.5);
  EXPECT_EQ(status.finished_intervals.size(), 1u);
}

}  // namespace
}  // namespace server::edits
