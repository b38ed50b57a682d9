#include "server/http/metrics.h"

#include <gtest/gtest.h>

namespace server::http {
namespace {

TEST(Metrics, KeepDurationsAndReasons) {
  Metrics metrics;
  for (const double seconds : {0.2, 5.0, 40.0})
    metrics.observe("splatdrag_edit_stage_seconds", "Time in a stage.", "stage", "deform", seconds);
  metrics.observe("splatdrag_edit_seconds", "Time.", "", "", 7);
  metrics.count_refused_upload("too_large");
  const std::string text = metrics.text();
  for (const std::string expected :
       {"splatdrag_edit_stage_seconds_count{stage=\"deform\"} 3\n",
        "splatdrag_edit_stage_seconds_bucket{stage=\"deform\",le=\"10\"} 2\n", "splatdrag_edit_seconds_sum 7\n",
        "splatdrag_uploads_refused_total{reason=\"too_large\"} 1\n"})
    EXPECT_NE(text.find(expected), std::string::npos) << expected << text;
}

TEST(Metrics, AskForGaugesWhenSomebodyLooks) {
  Metrics metrics;
  double scenes = 1;
  metrics.add_gauge("splatdrag_scenes", "Scenes held.", [&] { return scenes; });
  metrics.add_gauges("splatdrag_edits", "Edits by state.", "state", [] {
    return std::map<std::string, double>{{"queued", 2}, {"run\"ning", 3}};
  });
  scenes = 7;
  const std::string text = metrics.text();
  EXPECT_NE(text.find("# TYPE splatdrag_scenes gauge\nsplatdrag_scenes 7\n"), std::string::npos) << text;
  EXPECT_NE(text.find("splatdrag_edits{state=\"queued\"} 2\n"), std::string::npos) << text;
  EXPECT_NE(text.find("splatdrag_edits{state=\"run\\\"ning\"} 3\n"), std::string::npos) << text;
}

TEST(Metrics, CountRequestsAndTimeThem) {
  Metrics metrics;
  metrics.count_request("GET", "/x/{id}", 200, 0.003);
  metrics.count_request("GET", "/x/{id}", 200, 0.3);
  const std::string text = metrics.text();
  EXPECT_NE(text.find("splatdrag_http_requests_total{method=\"GET\",route=\"/x/{id}\",status=\"200\"} 2\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("splatdrag_http_request_seconds_bucket{route=\"/x/{id}\",le=\"0.1\"} 1\n"), std::string::npos)
      << text;
}

}  // namespace
}  // namespace server::http
