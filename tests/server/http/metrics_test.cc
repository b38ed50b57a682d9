#include "server/http/metrics.h"

#include <gtest/gtest.h>

namespace server::http {
namespace {

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
