// What the service counts, for Prometheus.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace server::http {

/// Safe to call from any thread.
class Metrics {
 public:
  Metrics();
  ~Metrics();

  /// A request has been answered.
  ///   route  as declared ("/v1/scenes/{id}"), never the path as sent: that would make a series per client's whim
  void count_request(std::string_view method, std::string_view route, int status, double seconds);
  void add_in_flight(int change);
  void add_stream(int change);
  void add_connection(int change);
  void add_waiting(int change);  ///< Requests that wait for a thread.
  /// A connection, or a request, was turned away because there were too many.
  void count_refused_connection();
  /// A connection whose client was waited for was ended to make room for others.
  void count_cut_connection();

  /// Observes a duration in a histogram, which the first call makes.
  ///   name     "splatdrag_edit_seconds", with its help
  ///   label    told apart by; its values are few, and no client's whim
  ///   seconds  up to an hour is told apart
  void observe(const std::string& name, const std::string& help, const std::string& label, const std::string& value,
               double seconds);
  /// An upload was refused.
  ///   reason  code of its error
  void count_refused_upload(std::string_view reason);

  /// A gauge whose value is computed whenever somebody reads the metrics.
  ///   name   "splatdrag_scenes"
  ///   value  called on a thread of the server; what it refers to outlives the metrics
  void add_gauge(std::string name, std::string help, std::function<double()> value);
  /// Several gauges of one name, told apart by a label.
  ///   values  by the label's value
  void add_gauges(std::string name, std::string help, std::string label,
                  std::function<std::map<std::string, double>()> values);

  /// All metrics, in the text format of Prometheus.
  [[nodiscard]] std::string text() const;
  static constexpr std::string_view media_type = "text/plain; version=0.0.4; charset=utf-8";

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace server::http
