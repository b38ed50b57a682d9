#include "server/http/metrics.h"

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <mutex>
#include <utility>
#include <vector>

namespace server::http {
namespace {

/// Seconds: a poll takes a millisecond, a render a tenth of a second, an upload minutes.
const prometheus::Histogram::BucketBoundaries& buckets() {
  static const prometheus::Histogram::BucketBoundaries seconds{0.001, 0.005, 0.02, 0.1, 0.5, 2, 10, 60, 300};
  return seconds;
}

/// Seconds: of edits, from a removal at once to an afternoon.
const prometheus::Histogram::BucketBoundaries& long_buckets() {
  static const prometheus::Histogram::BucketBoundaries seconds{0.1, 0.5, 2, 10, 30, 60, 300, 900, 3600};
  return seconds;
}

struct ComputedGauge {
  std::string name, help, label;
  std::function<std::map<std::string, double>()> values;
};

prometheus::MetricFamily family_of(const ComputedGauge& gauge) {
  prometheus::MetricFamily family;
  family.name = gauge.name;
  family.help = gauge.help;
  family.type = prometheus::MetricType::Gauge;
  for (const auto& [value, number] : gauge.values()) {
    prometheus::ClientMetric metric;
    if (!gauge.label.empty()) metric.label.push_back({gauge.label, value});
    metric.gauge.value = number;
    family.metric.push_back(std::move(metric));
  }
  return family;
}

}  // namespace

struct Metrics::Impl {
  prometheus::Registry registry;
  prometheus::Family<prometheus::Counter>& requests =
      prometheus::BuildCounter().Name("splatdrag_http_requests_total").Help("Requests answered.").Register(registry);
  prometheus::Family<prometheus::Histogram>& seconds = prometheus::BuildHistogram()
                                                           .Name("splatdrag_http_request_seconds")
                                                           .Help("Time from a request's head to the end of its answer.")
                                                           .Register(registry);
  prometheus::Gauge& in_flight = prometheus::BuildGauge()
                                     .Name("splatdrag_http_requests_in_flight")
                                     .Help("Requests being answered now.")
                                     .Register(registry)
                                     .Add({});
  prometheus::Gauge& streams = prometheus::BuildGauge()
                                   .Name("splatdrag_http_streams_open")
                                   .Help("Streams of events open now.")
                                   .Register(registry)
                                   .Add({});
  prometheus::Gauge& connections = prometheus::BuildGauge()
                                       .Name("splatdrag_http_connections_open")
                                       .Help("Connections open now.")
                                       .Register(registry)
                                       .Add({});
  prometheus::Gauge& waiting = prometheus::BuildGauge()
                                   .Name("splatdrag_http_requests_waiting")
                                   .Help("Requests that wait for a thread.")
                                   .Register(registry)
                                   .Add({});
  prometheus::Counter& refused = prometheus::BuildCounter()
                                     .Name("splatdrag_http_connections_refused_total")
                                     .Help("Connections and requests turned away because there were too many.")
                                     .Register(registry)
                                     .Add({});
  prometheus::Counter& cut =
      prometheus::BuildCounter()
          .Name("splatdrag_http_connections_cut_total")
          .Help("Connections ended, while their clients were waited for, to make room for others.")
          .Register(registry)
          .Add({});
  prometheus::Family<prometheus::Counter>& refused_uploads = prometheus::BuildCounter()
                                                                 .Name("splatdrag_uploads_refused_total")
                                                                 .Help("Uploads refused, by the code of the error.")
                                                                 .Register(registry);
  mutable std::mutex mutex;  ///< Guards computed_gauges.
  std::vector<ComputedGauge> computed_gauges;
};

Metrics::Metrics() : impl_(std::make_unique<Impl>()) {}
Metrics::~Metrics() = default;

void Metrics::count_request(std::string_view method, std::string_view route, int status, double seconds) {
  impl_->requests
      .Add({{"method", std::string(method)}, {"route", std::string(route)}, {"status", std::to_string(status)}})
      .Increment();
  impl_->seconds.Add({{"route", std::string(route)}}, buckets()).Observe(seconds);
}

void Metrics::observe(const std::string& name, const std::string& help, const std::string& label,
                      const std::string& value, double seconds) {
  const prometheus::Labels labels = label.empty() ? prometheus::Labels{} : prometheus::Labels{{label, value}};
  prometheus::BuildHistogram()
      .Name(name)
      .Help(help)
      .Register(impl_->registry)
      .Add(labels, long_buckets())
      .Observe(seconds);
}

void Metrics::count_refused_upload(std::string_view reason) {
  impl_->refused_uploads.Add({{"reason", std::string(reason)}}).Increment();
}

void Metrics::add_in_flight(int change) { impl_->in_flight.Increment(change); }

void Metrics::add_stream(int change) { impl_->streams.Increment(change); }

void Metrics::add_connection(int change) { impl_->connections.Increment(change); }

void Metrics::add_waiting(int change) { impl_->waiting.Increment(change); }

void Metrics::count_refused_connection() { impl_->refused.Increment(); }

void Metrics::count_cut_connection() { impl_->cut.Increment(); }

void Metrics::add_gauge(std::string name, std::string help, std::function<double()> value) {
  add_gauges(std::move(name), std::move(help), "", [value = std::move(value)] {
    return std::map<std::string, double>{{"", value()}};
  });
}

void Metrics::add_gauges(std::string name, std::string help, std::string label,
                         std::function<std::map<std::string, double>()> values) {
  const std::lock_guard lock(impl_->mutex);
  impl_->computed_gauges.push_back({std::move(name), std::move(help), std::move(label), std::move(values)});
}

std::string Metrics::text() const {
  std::vector<ComputedGauge> gauges;
  {
    const std::lock_guard lock(impl_->mutex);
    gauges = impl_->computed_gauges;
  }
  auto families = impl_->registry.Collect();
  for (const ComputedGauge& gauge : gauges) families.push_back(family_of(gauge));
  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace server::http
