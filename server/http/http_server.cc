#include "server/http/http_server.h"

#include <httplib.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <mutex>
#include <set>
#include <thread>

#include "proto/problem.h"
#include "server/http/listener.h"
#include "server/http/log.h"
#include "server/http/negotiation.h"
#include "server/http/thread_pool.h"

namespace server::http {
namespace {

using Clock = std::chrono::steady_clock;

/// Most bytes of an unread body that are read and discarded so that its connection can be kept. A choice.
constexpr std::size_t max_discarded_bytes = 64 * 1024;
/// Bytes of a file that are read and sent at a time. A choice.
constexpr std::size_t file_piece = 256 * 1024;

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

/// A connection as httplib sees it: the request above, then the body without its framing up to its end.
class Stream final : public httplib::Stream {
 public:
  Stream(Connection& connection, std::string request) : connection_(connection), request_(std::move(request)) {}

  [[nodiscard]] bool is_readable() const override { return true; }
  [[nodiscard]] bool is_writable() const override { return true; }  // write() waits, with a limit
  ssize_t read(char* to, std::size_t size) override {
    if (read_ == request_.size()) return connection_.read_body(to, size);
    const std::size_t taken = std::min(size, request_.size() - read_);
    request_.copy(to, taken, read_);
    read_ += taken;
    return ssize_t(taken);
  }
  ssize_t write(const char* from, std::size_t size) override {
    written_ = written_ && connection_.write({from, size});
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
  bool written_ = true;
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

bool send_file(const Answer::FilePart& file, std::size_t begin, std::size_t length, httplib::DataSink& sink) {
  std::vector<char> piece(std::min<std::size_t>(file_piece, length));
  const ssize_t got = ::pread(file.descriptor->get(), piece.data(), piece.size(), off_t(file.offset + begin));
  // A file that has become shorter cannot be sent as promised; breaking off says so.
  return got > 0 && sink.write(piece.data(), std::size_t(got));
}

/// An answer to a request that could not be read, or that there is no thread for.
std::string raw_answer(const Refusal& refusal, const std::string& request_id) {
  const Answer answer = Dispatcher::refused(refusal, request_id);
  std::string text =
      "HTTP/1.1 " + std::to_string(answer.status) + " " + std::string(proto::status_phrase(answer.status)) + "\r\n";
  for (const auto& [name, value] : answer.headers) text += name + ": " + value + "\r\n";
  return text + "Content-Length: " + std::to_string(answer.body.size()) + "\r\nConnection: close\r\n\r\n" + answer.body;
}

std::string counted_method(const std::string& method) {
  for (const char* known : {"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
    if (method == known) return method;
  return "other";
}

}  // namespace

struct HttpServer::Impl {
  Impl(const ServerOptions& server_options, Router router, AccessGuard& guard, Metrics& server_metrics,
       spdlog::logger& server_logger)
      : options(server_options),
        metrics(server_metrics),
        logger(server_logger),
        dispatcher(std::move(router), guard, logger, options.dispatcher,
                   [this](int change) { metrics.add_stream(change); }),
        pool(options.threads, options.max_waiting, [this] { return make_server(); }) {}
  ~Impl() {
    if (listening >= 0) ::close(listening);
    if (stopping >= 0) ::close(stopping);
  }

  [[nodiscard]] ThreadPool::Serve make_server();
  void accept_connections();
  void take(int socket);
  void turn_away(int socket);
  void cut_connections();
  void stop();

  const ServerOptions options;
  Metrics& metrics;
  spdlog::logger& logger;
  int listening = -1, stopping = -1;  ///< Sockets; `stopping` becomes readable.
  int port = 0;
  Dispatcher dispatcher;
  std::mutex mutex;       ///< Guards sockets.
  std::set<int> sockets;  ///< Of the connections being served.
  std::once_flag stopped;
  std::thread acceptor;
  ThreadPool pool;  ///< Last: its threads use all of the above.
};

namespace {

/// What one thread serves connections with.
class ConnectionServer final : private httplib::Server {
 public:
  ConnectionServer(const ServerOptions& options, Dispatcher& dispatcher, Metrics& metrics, spdlog::logger& logger)
      : options_(options), dispatcher_(dispatcher), metrics_(metrics), logger_(logger) {
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

  void serve(Connection& connection) {
    connection_ = &connection;
    client_ = connection.client();
    for (int left = options_.max_requests; left > 0; --left)
      if (!serve_one(/*last=*/left == 1)) break;
  }

 private:
  /// Whether another request may follow.
  bool serve_one(bool last) {
    const auto text = connection_->read_head();
    if (text && !*text) return false;
    const auto began = Clock::now();
    const auto head = text ? parse_head(**text) : tl::make_unexpected(text.error());
    connection_->begin_answer();
    if (!head) {
      const std::string id = random_id();
      if (connection_->write(raw_answer(head.error(), id))) connection_->linger();
      report(id, "-", "-", head.error().status, began);
      return false;
    }
    const Underway underway(*this);
    const bool keep = answer_to(*head, last);
    const bool is_upload = head->has_body() && media_type_of(head->header("content-type")) != "application/json";
    if (is_upload && !answer_.refusal.empty()) metrics_.count_refused_upload(answer_.refusal);
    report(request_id_, counted_method(head->method), answer_.route, answer_.status, began);
    return keep;
  }

  /// An answer under way: what it holds is given back however it ends.
  class Underway {
   public:
    explicit Underway(ConnectionServer& server) : worker_(server) { worker_.metrics_.add_in_flight(1); }
    ~Underway() {
      worker_.answer_ = {};
      worker_.metrics_.add_in_flight(-1);
    }
    Underway(const Underway&) = delete;
    Underway& operator=(const Underway&) = delete;

   private:
    ConnectionServer& worker_;
  };

  bool answer_to(const RequestHead& head, bool last) {
    head_ = &head;
    last_ = last;
    request_id_ = request_id_of(head);
    connection_->begin_body(head);
    Stream stream(*connection_, request_for_httplib(head));
    bool closed = false;
    const bool processed = process_request(stream, true, closed, nullptr);
    if (!processed || !stream.written()) return false;
    if (!keep_) connection_->linger();
    return keep_;
  }

  void answer(httplib::Response& response, const httplib::ContentReader* reader) {
    form_.set(reader);
    answer_ = dispatcher_.answer(*head_, request_id_, *connection_, form_);
    form_.set(nullptr);
    // The next request begins where this body ends. If that is far, the connection ends instead; and nobody waits for a
    // body to tell that it is not wanted.
    const bool refused = answer_.status >= 400;
    keep_ = head_->keep_alive && !last_ && connection_->finish_body(max_discarded_bytes, !refused) &&
            connection_->open() && !(answer_.events && head_->is_http_1_0);
    response.status = answer_.status;
    for (const auto& [name, value] : answer_.headers) response.headers.emplace(name, value);
    response.body = std::move(answer_.body);
    const auto found = response.headers.find("Content-Type");
    const std::string type = found == response.headers.end() ? "" : found->second;
    if (answer_.file && answer_.file->length > 0) {
      response.headers.erase("Content-Type");
      response.set_content_provider(answer_.file->length, type,
                                    [this](std::size_t begin, std::size_t length, httplib::DataSink& sink) {
                                      return send_file(*answer_.file, begin, length, sink);
                                    });
    } else if (answer_.events) {
      response.headers.erase("Content-Type");
      const auto provider = [this](std::size_t, httplib::DataSink& sink) { return send_events(sink); };
      if (head_->is_http_1_0)
        response.set_content_provider(type, provider);
      else
        response.set_chunked_content_provider(type, provider);
    }
  }

  bool send_events(httplib::DataSink& sink) {
    Sink events(sink, *connection_);
    try {
      answer_.events(events);
    } catch (const std::exception& bug) {
      log(logger_, spdlog::level::err, std::string("bug: ") + bug.what(),
          {{"request_id", request_id_}, {"route", answer_.route}});
      return false;
    }
    sink.done();
    return true;
  }

  /// The last word on the headers, after httplib's.
  void finish(httplib::Response& response) const {
    for (const char* name : {"Keep-Alive", "Connection"}) response.headers.erase(name);
    if (!keep_) response.headers.emplace("Connection", "close");
    if (!answer_.file) response.headers.erase("Accept-Ranges");
    // The length of what would have been sent is not 0, and 204 has none (RFC 9110, section 8.6).
    if (response.status == 204 || response.status == 304) response.headers.erase("Content-Length");
    if (head_->method == "HEAD" && answer_.events) response.headers.erase("Transfer-Encoding");
  }

  void report(const std::string& id, const std::string& method, const std::string& route, int status,
              Clock::time_point began) const {
    const double seconds = std::chrono::duration<double>(Clock::now() - began).count();
    metrics_.count_request(method, route, status, seconds);
    log(logger_, status >= 500 ? spdlog::level::warn : spdlog::level::info, "request",
        {{"request_id", id},
         {"method", method},
         {"route", route},
         {"status", std::int64_t{status}},
         {"bytes", std::int64_t(connection_->bytes_written())},
         {"ms", std::round(seconds * 1e5) / 100},
         {"client", client_}});
  }

  const ServerOptions& options_;
  Dispatcher& dispatcher_;
  Metrics& metrics_;
  spdlog::logger& logger_;
  // What follows belongs to the connection being served, and to its request.
  Connection* connection_ = nullptr;
  const RequestHead* head_ = nullptr;
  std::string client_, request_id_;
  Answer answer_;
  Form form_;
  bool last_ = false, keep_ = false;
};

}  // namespace

ThreadPool::Serve HttpServer::Impl::make_server() {
  const auto server = std::make_shared<ConnectionServer>(options, dispatcher, metrics, logger);
  return [this, server](int socket) {
    {
      Connection connection(socket, options.connection, {stopping, [this] { return pool.has_waiting(); }});
      {
        const std::lock_guard lock(mutex);
        sockets.insert(socket);
      }
      try {
        server->serve(connection);
      } catch (const std::exception& bug) {
        log(logger, spdlog::level::err, std::string("bug: ") + bug.what());
      } catch (...) {
        log(logger, spdlog::level::err, "bug: something was thrown that is no exception");
      }
      const std::lock_guard lock(mutex);
      sockets.erase(socket);  // before the socket is closed and its number used again
    }
  };
}

void HttpServer::Impl::accept_connections() {
  for (;;) {
    std::array<pollfd, 2> watched{{{listening, POLLIN, 0}, {stopping, POLLIN, 0}}};
    if (::poll(watched.data(), watched.size(), -1) < 0 && errno != EINTR) return;
    if (watched[1].revents != 0) return;
    if (watched[0].revents == 0) continue;
    const int socket = ::accept4(listening, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (socket >= 0) {
      take(socket);
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      // Connections wait in the system's own line until some of ours end.
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
}

void HttpServer::Impl::take(int socket) {
  const int yes = 1;
  ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  if (!pool.offer(socket)) turn_away(socket);
}

/// Never waits: this is the thread that accepts.
void HttpServer::Impl::turn_away(int socket) {
  metrics.count_refused_connection();
  const std::string id = random_id();
  const std::string text =
      raw_answer({503, "unavailable", "too many connections wait already; try again soon", ""}, id);
  [[maybe_unused]] const ssize_t sent = ::send(socket, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  ::shutdown(socket, SHUT_WR);
  // What the client has sent is read, or closing would take the answer back.
  std::array<char, 4096> discarded;
  [[maybe_unused]] const ssize_t got = ::recv(socket, discarded.data(), discarded.size(), MSG_DONTWAIT);
  ::close(socket);
  log(logger, spdlog::level::warn, "connection refused: too many wait", {{"request_id", id}});
}

void HttpServer::Impl::cut_connections() {
  const std::lock_guard lock(mutex);
  for (const int socket : sockets) ::shutdown(socket, SHUT_RDWR);
}

void HttpServer::Impl::stop() {
  const std::uint64_t one = 1;
  while (::write(stopping, &one, sizeof one) < 0 && errno == EINTR) continue;
  if (acceptor.joinable()) acceptor.join();
  ::close(listening);
  listening = -1;
  pool.close();
  if (!pool.idle_within(options.grace)) {
    log(logger, spdlog::level::warn, "cutting connections that outlasted the grace period");
    cut_connections();
    while (!pool.idle_within(std::chrono::seconds(1))) cut_connections();
  }
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

HttpServer::~HttpServer() { stop(); }

engine::Result<std::unique_ptr<HttpServer>> HttpServer::start(const ServerOptions& options, Router router,
                                                              AccessGuard& guard, Metrics& metrics,
                                                              spdlog::logger& logger) {
  auto impl = std::make_unique<Impl>(options, std::move(router), guard, metrics, logger);
  const auto socket = listen_on(options.host, options.port);
  if (!socket) return engine::propagate(socket);
  impl->listening = *socket;
  impl->stopping = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (impl->stopping < 0) return engine::fail(engine::ErrorCode::unavailable, "this process may open no more files");
  impl->port = bound_port(*socket);
  guard.bound_to(options.host, impl->port);
  impl->acceptor = std::thread([raw = impl.get()] { raw->accept_connections(); });
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

int HttpServer::port() const { return impl_->port; }

std::string HttpServer::url() const {
  const std::string& host = impl_->options.host;
  const bool bare_ipv6 = host.find(':') != std::string::npos && !host.starts_with('[');
  return "http://" + (bare_ipv6 ? "[" + host + "]" : host) + ":" + std::to_string(impl_->port);
}

void HttpServer::stop() {
  std::call_once(impl_->stopped, [this] { impl_->stop(); });
}

}  // namespace server::http
