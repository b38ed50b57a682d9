#include "server/http/answerer.h"

#include <httplib.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <exception>
#include <string>
#include <utility>

#include "proto/problem.h"
#include "server/http/log.h"
#include "server/http/negotiation.h"

namespace server::http {
namespace {

using Clock = std::chrono::steady_clock;

/// Most bytes of an unread body that are read and discarded so that its connection can be kept. A choice.
constexpr std::size_t max_discarded_bytes = 64 * 1024;
/// Most bytes of a file that are sent at a time; then others have their turn. A choice.
constexpr std::uint64_t max_sent_at_a_time = std::uint64_t{64} << 20;

/// A request as httplib gets to see it. What a client sent has been parsed and guarded before; httplib's own parsing of
/// paths, ranges and encodings (regular expressions over what a stranger sends, no limit on the number of headers or on
/// a chunk's size line) never meets it. It takes forms apart and writes answers.
std::string request_for_httplib(const RequestHead& head) {
  std::string text = head.method == "HEAD" ? "HEAD" : head.has_body() ? "POST" : "GET";
  text += " / HTTP/1.1\r\n";
  if (const auto boundary = boundary_of(head.header("content-type")))
    text += "Content-Type: multipart/form-data; boundary=" + *boundary + "\r\n";
  return text + "\r\n";
}

/// A visit as httplib sees it: the request above, then the body without its framing up to its end. Answers are posted,
/// so that nobody waits for their clients; only streams of events are written at the speed of theirs.
class Stream final : public httplib::Stream {
 public:
  Stream(Connection& connection, std::string request) : connection_(connection), request_(std::move(request)) {}

  /// From now on what is written is waited for.
  void wait_for_client() { waits_ = true; }
  /// While `swallows`, what is written has been sent in another way.
  void swallow(bool swallows) { swallows_ = swallows; }

  [[nodiscard]] bool is_readable() const override { return true; }
  [[nodiscard]] bool is_writable() const override { return true; }  // write() keeps what the client does not take
  ssize_t read(char* to, std::size_t size) override {
    if (read_ == request_.size()) return connection_.read_body(to, size);
    const std::size_t taken = std::min(size, request_.size() - read_);
    request_.copy(to, taken, read_);
    read_ += taken;
    return ssize_t(taken);
  }
  ssize_t write(const char* from, std::size_t size) override {
    if (swallows_) return ssize_t(size);
    written_ = written_ && (waits_ ? connection_.write({from, size}) : connection_.post({from, size}));
    return written_ ? ssize_t(size) : -1;
  }
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  /// httplib only asks whether select() could take it.
  [[nodiscard]] socket_t socket() const override { return 0; }
  [[nodiscard]] bool written() const { return written_; }

 private:
  Connection& connection_;
  const std::string request_;
  std::size_t read_ = 0;
  bool written_ = true, waits_ = false, swallows_ = false;
};

class Form final : public FormReader {
 public:
  void set(const httplib::ContentReader* reader) { reader_ = reader; }
  bool read(const std::function<bool(const std::string&)>& part,
            const std::function<bool(std::string_view)>& data) override {
    if (reader_ == nullptr) return false;
    return (*reader_)([&](const httplib::MultipartFormData& header) { return part(header.filename); },
                      [&](const char* bytes, std::size_t size) {
                        return data({bytes, size});
                      });
  }

 private:
  const httplib::ContentReader* reader_ = nullptr;
};

class Sink final : public EventSink {
 public:
  Sink(httplib::DataSink& sink, const Connection& connection) : sink_(sink), connection_(connection) {}

  bool send(std::string_view event, std::string_view id, std::string_view data) override {
    std::string text = "event: " + one_line(event) + "\nid: " + one_line(id) + "\n";
    for (std::size_t begin = 0; begin <= data.size();) {
      const std::size_t end = std::min(data.find('\n', begin), data.size());
      text += "data: " + one_line(data.substr(begin, end - begin)) + "\n";
      begin = end + 1;
    }
    return put(text + "\n");
  }
  bool keep_alive() override { return put(": still here\n\n"); }
  [[nodiscard]] bool open() const override { return alive_ && connection_.open(); }

 private:
  static std::string one_line(std::string_view text) {
    std::string line(text);
    std::erase_if(line, [](char c) { return c == '\r' || c == '\n'; });
    return line;
  }
  bool put(const std::string& text) {
    alive_ = open() && sink_.write(text.data(), text.size());
    return alive_;
  }

  httplib::DataSink& sink_;
  const Connection& connection_;
  bool alive_ = true;
};

/// An answer to a request that could not be read, or that there is no thread for.
std::string raw_answer(const Refusal& refusal, const std::string& request_id, const std::string& method) {
  const Answer answer = Dispatcher::refused(refusal, request_id);
  std::string text =
      "HTTP/1.1 " + std::to_string(answer.status) + " " + std::string(proto::status_phrase(answer.status)) + "\r\n";
  for (const auto& [name, value] : answer.headers) text += name + ": " + value + "\r\n";
  text += "Content-Length: " + std::to_string(answer.body.size()) + "\r\nConnection: close\r\n\r\n";
  return method == "HEAD" ? text : text + answer.body;
}

std::string counted_method(const std::string& method) {
  for (const char* known : {"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
    if (method == known) return method;
  return "other";
}

/// What the audit log says of a request that has its answer.
proto::AuditEntry audit_entry(const Visit& visit) {
  const Answer& answer = visit.answer;
  const CheckedRequest& checked = *visit.checked;
  proto::AuditEntry entry{.time = std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now()),
                          .request_id = visit.request_id,
                          .token = checked.token == nullptr ? "" : checked.token->name,
                          .address = visit.client,
                          .method = counted_method(visit.head.method),
                          .route = answer.route,
                          .about = things_named(checked.match),
                          .status = answer.status,
                          .refusal = answer.refusal};
  for (const auto& [name, value] : answer.headers)
    if (name == "Location")
      if (auto made = thing_at_end(value)) entry.about.push_back(std::move(*made));
  entry.about.insert(entry.about.end(), answer.about.begin(), answer.about.end());
  return entry;
}

void report(const Visit& visit, const std::string& id, const std::string& method, const std::string& route, int status,
            Metrics& metrics, spdlog::logger& logger) {
  const double seconds = std::chrono::duration<double>(Clock::now() - visit.arrived).count();
  metrics.count_request(method, route, status, seconds);
  log(logger, status >= 500 ? spdlog::level::warn : spdlog::level::info, "request",
      {{"request_id", id},
       {"method", method},
       {"route", route},
       {"status", std::int64_t{status}},
       {"bytes", std::int64_t(visit.connection.bytes_written())},
       {"ms", std::round(seconds * 1e5) / 100},
       {"client", visit.client.empty() ? visit.connection.client() : visit.client}});
}

void post_refusal(Visit& visit, const Refusal& refusal, const std::string& id, const std::string& method,
                  Metrics& metrics, spdlog::logger& logger) {
  visit.connection.begin_answer();
  // What the client does not take at once it does not get: it is short, and its client has been heard.
  visit.connection.post(raw_answer(refusal, id, method));
  report(visit, id, method, "-", refusal.status, metrics, logger);
}

class Answerer final : private httplib::Server {
 public:
  explicit Answerer(const AnswererParts& parts) : parts_(parts) {
    svr_sock_ = 0;  // to httplib, an invalid one means that the server stops
    Get("/", [this](const httplib::Request&, httplib::Response& response) { answer(response, nullptr); });
    Post("/", [this](const httplib::Request&, httplib::Response& response, const httplib::ContentReader& reader) {
      answer(response, &reader);
    });
    // What breaks an answer ends its connection.
    set_exception_handler([](const httplib::Request&, httplib::Response&, const std::exception_ptr& broken) {
      std::rethrow_exception(broken);
    });
    set_post_routing_handler([this](const httplib::Request&, httplib::Response& response) { finish(response); });
  }

  void serve(Visit& visit) {
    visit_ = &visit;
    try {
      if (visit.is_answered || (may_begin() && begin())) send();
    } catch (const std::exception& bug) {
      log(parts_.logger, spdlog::level::err, std::string("bug: ") + bug.what());
      visit.next = Next::end;
    } catch (...) {
      log(parts_.logger, spdlog::level::err, "bug: something was thrown that is no exception");
      visit.next = Next::end;
    }
    if (visit.next == Next::end) visit.end_request();  // before it is handed on
    visit_ = nullptr;
  }

 private:
  /// Whether the request can be answered now. Whoever is refused is told so at once; of those who are let in, a small
  /// body is received without a thread, another one by a thread of those for uploads.
  bool may_begin() {
    Visit& visit = *visit_;
    if (!visit.checked) visit.checked = parts_.dispatcher.check(visit.head, visit.client);
    if (visit.checked->refusal || visit.awaits_no_body || visit.connection.body_is_here()) return true;
    visit.awaits_no_body = true;
    if (visit.connection.body_is_small()) {
      visit.next = Next::read_body;
      return false;
    }
    if (parts_.workers.uploads_are_full()) {
      visit.checked->refusal = Refusal{503, "unavailable", "too many uploads wait already; try again soon", ""};
      return true;
    }
    visit.next = Next::begin_upload;
    return false;
  }

  /// Answers the request, as far as its client takes it at once.
  ///   returns  false: its connection ends
  bool begin() {
    Visit& visit = *visit_;
    Metrics& metrics = parts_.metrics;
    metrics.add_in_flight(1);
    visit.under_way = std::shared_ptr<const void>(nullptr, [&metrics](const void*) { metrics.add_in_flight(-1); });
    visit.connection.begin_answer();
    Stream stream(visit.connection, request_for_httplib(visit.head));
    stream_ = &stream;
    bool closed = false;
    const bool processed = process_request(stream, true, closed, nullptr);
    stream_ = nullptr;
    visit.is_answered = true;
    if (processed && stream.written()) return true;
    end_answer(Next::end);
    return false;
  }

  /// Sends what is left of the answer, as far as its client takes it at once.
  void send() {
    switch (visit_->connection.send_now(max_sent_at_a_time)) {
      case Connection::Sending::done:
        return end_answer(visit_->keep ? Next::read_head : Next::say_goodbye);
      case Connection::Sending::waiting:
        visit_->next = Next::send_on;
        return;
      case Connection::Sending::broken:
        return end_answer(Next::end);
    }
  }

  void end_answer(Next next) {
    Visit& visit = *visit_;
    visit.next = next;
    const bool is_upload =
        visit.head.has_body() && media_type_of(visit.head.header("content-type")) != "application/json";
    if (is_upload && !visit.answer.refusal.empty()) parts_.metrics.count_refused_upload(visit.answer.refusal);
    const std::string route = visit.answer.route;
    const int status = visit.answer.status;
    visit.end_request();
    report(visit, visit.request_id, counted_method(visit.head.method), route, status, parts_.metrics, parts_.logger);
  }

  /// The handler of all requests, as httplib sees it.
  void answer(httplib::Response& response, const httplib::ContentReader* reader) {
    Visit& visit = *visit_;
    Connection& connection = visit.connection;
    form_.set(reader);
    visit.answer = parts_.dispatcher.answer(*visit.checked, visit.head, visit.request_id, connection, form_);
    form_.set(nullptr);
    Answer& answer = visit.answer;
    if (visit.checked->is_audited && parts_.audit != nullptr) parts_.audit->write(audit_entry(visit));
    // The next request begins where this body ends. If that is far, the connection ends instead; and nobody waits for a
    // body to tell that it is not wanted.
    const bool refused = answer.status >= 400, last = visit.requests >= parts_.max_requests;
    visit.keep = visit.head.keep_alive && !last && connection.finish_body(max_discarded_bytes, !refused) &&
                 connection.open() && !(answer.events && visit.head.is_http_1_0);
    response.status = answer.status;
    for (const auto& [name, value] : answer.headers) response.headers.emplace(name, value);
    response.body = std::move(answer.body);
    const auto found = response.headers.find("Content-Type");
    const std::string type = found == response.headers.end() ? "" : found->second;
    if (answer.file && answer.file->length > 0) {
      response.headers.erase("Content-Type");
      response.set_content_provider(
          answer.file->length, type,
          [this](std::size_t, std::size_t length, httplib::DataSink& sink) { return post_file(length, sink); });
    } else if (answer.events) {
      response.headers.erase("Content-Type");
      const auto provider = [this](std::size_t, httplib::DataSink& sink) { return send_events(sink); };
      if (visit.head.is_http_1_0)
        response.set_content_provider(type, provider);
      else
        response.set_chunked_content_provider(type, provider);
    }
  }

  /// httplib is made to believe that it sends the file, so that its headers say so; the system sends it from the disk.
  bool post_file(std::size_t length, httplib::DataSink& sink) {
    static constexpr std::array<char, 64 * 1024> nothing{};
    const Answer::FilePart& file = *visit_->answer.file;
    visit_->connection.post_file(file.descriptor, file.offset, file.length);
    stream_->swallow(true);
    bool written = true;
    for (std::size_t left = length; left > 0 && written; left -= std::min(left, nothing.size()))
      written = sink.write(nothing.data(), std::min(left, nothing.size()));
    stream_->swallow(false);
    return written;
  }

  bool send_events(httplib::DataSink& sink) {
    Visit& visit = *visit_;
    parts_.workers.step_aside(visit);
    stream_->wait_for_client();
    Sink events(sink, visit.connection);
    try {
      visit.answer.events(events);
    } catch (const std::exception& bug) {
      log(parts_.logger, spdlog::level::err, std::string("bug: ") + bug.what(),
          {{"request_id", visit.request_id}, {"route", visit.answer.route}});
      return false;
    }
    sink.done();
    return true;
  }

  /// The last word on the headers, after httplib's.
  void finish(httplib::Response& response) const {
    const Visit& visit = *visit_;
    for (const char* name : {"Keep-Alive", "Connection"}) response.headers.erase(name);
    if (!visit.keep) response.headers.emplace("Connection", "close");
    const auto seconds = std::chrono::floor<std::chrono::seconds>(parts_.idle_timeout).count();
    if (visit.keep && seconds > 0) response.headers.emplace("Keep-Alive", "timeout=" + std::to_string(seconds));
    if (!visit.answer.file) response.headers.erase("Accept-Ranges");
    // The length of what would have been sent is not 0, and 204 has none (RFC 9110, section 8.6).
    if (response.status == 204 || response.status == 304) response.headers.erase("Content-Length");
    if (visit.head.method == "HEAD" && visit.answer.events) response.headers.erase("Transfer-Encoding");
  }

  const AnswererParts parts_;
  // What follows belongs to the visit being served.
  Visit* visit_ = nullptr;
  Stream* stream_ = nullptr;
  Form form_;
};

}  // namespace

Workers::Serve make_answerer(const AnswererParts& parts) {
  const auto answerer = std::make_shared<Answerer>(parts);
  return [answerer](Visit& visit) { answerer->serve(visit); };
}

void refuse(Visit& visit, const Refusal& refusal, Metrics& metrics, spdlog::logger& logger) {
  post_refusal(visit, refusal, random_id(), "-", metrics, logger);
}

void refuse_request(Visit& visit, const Refusal& refusal, Metrics& metrics, spdlog::logger& logger) {
  post_refusal(visit, refusal, visit.request_id, counted_method(visit.head.method), metrics, logger);
}

}  // namespace server::http
