// A service under load: many clients look, pick and poll while edits run. Prints what they waited, and what memory the
// service took. Closed loop: a client sends its next request when it has the answer to the last, or `--think` later.
// With `--alone` edits are first carried out before any client comes, to tell what clients cost them.
//
//     splatdrag serve --port 8080 --data-dir data &
//     service_load --url http://127.0.0.1:8080 --scene s000001 --edit drag.json --pid $! --markdown
#include <arpa/inet.h>
#include <httplib.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;
using nlohmann::json;

struct Options {
  std::string url = "http://127.0.0.1:8080", scene, edit, token;
  int version = 0;
  int clients = 16;
  double seconds = 120, think_ms = 0;
  int pid = 0, alone = 0;
  int dripping = 0;
  int width = 640, height = 360;
  bool markdown = false;
};

/// What clients ask for, and how often each: of ten requests so many.
enum Kind { poll, render, pick, kinds };
constexpr std::array<const char*, kinds> kind_names{"poll of the edit", "render", "pick"};
constexpr std::array<int, kinds> share{4, 4, 2};

struct Tally {
  std::array<std::vector<float>, kinds> milliseconds;  ///< Of answers that were none of an error.
  std::array<std::size_t, kinds> errors{};
  std::map<std::string, std::size_t> complaints;  ///< How often each.
};

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

httplib::Client connect(const Options& options) {
  httplib::Client client(options.url);
  client.set_keep_alive(true);
  client.set_tcp_nodelay(true);
  client.set_read_timeout(60);
  if (!options.token.empty()) client.set_bearer_token_auth(options.token);
  return client;
}

/// The answer's JSON.
json expect_json(const httplib::Result& result, const std::string& what) {
  if (!result) throw std::runtime_error(what + ": " + httplib::to_string(result.error()));
  if (result->status >= 300)
    throw std::runtime_error(what + ": " + std::to_string(result->status) + " " + result->body);
  return json::parse(result->body);
}

/// Where the camera looks, and from how far.
struct SceneExtent {
  std::array<double, 3> centre{}, up{};
  double radius = 1;
};

SceneExtent find_extent(const Options& options) {
  auto client = connect(options);
  const json scene = expect_json(client.Get("/v1/scenes/" + options.scene), "the scene");
  SceneExtent extent;
  extent.centre = scene["centre"].get<std::array<double, 3>>();
  extent.up = scene["up"].is_null() ? std::array<double, 3>{0, -1, 0} : scene["up"].get<std::array<double, 3>>();
  extent.radius = std::max(scene["radius"].get<double>(), 1e-6);
  return extent;
}

/// A camera on a sphere around the scene that no request has used before.
json new_camera(const Options& options, const SceneExtent& extent, std::size_t number) {
  constexpr double golden_angle = 2 * std::numbers::pi * (2 - std::numbers::phi);
  const double turn = golden_angle * double(number), tilt = 0.4 * std::sin(0.37 * double(number));
  const double distance = 4 * extent.radius;
  const std::array<double, 3> out{std::cos(turn) * std::cos(tilt), std::sin(tilt), std::sin(turn) * std::cos(tilt)};
  // `out` is upright along y: its axes are dealt out so that y falls on the scene's main upward axis.
  const std::size_t upright = std::max_element(extent.up.begin(), extent.up.end(),
                                               [](double a, double b) { return std::abs(a) < std::abs(b); }) -
                              extent.up.begin();
  std::array<double, 3> eye = extent.centre;
  eye[upright] += distance * out[1];
  eye[(upright + 1) % 3] += distance * out[0];
  eye[(upright + 2) % 3] += distance * out[2];
  return {{"eye", eye},      {"target", extent.centre}, {"up", extent.up},
          {"fov_y_deg", 50}, {"width", options.width},  {"height", options.height}};
}

/// Clients that send a byte of a request's head now and then, and never come to its end.
class Drippers {
 public:
  explicit Drippers(const Options& options) {
    const std::size_t colon = options.url.rfind(':');
    const bool is_local = options.url.substr(0, colon) == "http://127.0.0.1";
    if (options.dripping > 0 && !is_local) throw std::runtime_error("--dripping is for http://127.0.0.1:PORT alone");
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (is_local) address_.sin_port = htons(std::uint16_t(std::stoi(options.url.substr(colon + 1))));
    for (int i = 0; i < options.dripping; ++i) sockets_.push_back(connect());
  }
  ~Drippers() {
    for (const int socket : sockets_) ::close(socket);
  }
  Drippers(const Drippers&) = delete;
  Drippers& operator=(const Drippers&) = delete;

  void drip_until(Clock::time_point end) {
    while (!sockets_.empty() && Clock::now() < end) {
      for (int& socket : sockets_) {
        if (::send(socket, "x", 1, MSG_NOSIGNAL | MSG_DONTWAIT) == 1) continue;
        ::close(socket);
        socket = connect();
        ++cut_off_;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }
  [[nodiscard]] std::size_t cut_off() const { return cut_off_; }

 private:
  /// -1 where that fails; it is tried again.
  [[nodiscard]] int connect() const {
    const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    constexpr std::string_view begin = "GET /v1/info HTTP/1.1\r\nX: ";
    if (::connect(socket, reinterpret_cast<const sockaddr*>(&address_), sizeof address_) == 0 &&
        ::send(socket, begin.data(), begin.size(), MSG_NOSIGNAL) > 0)
      return socket;
    ::close(socket);
    return -1;
  }

  sockaddr_in address_{};
  std::vector<int> sockets_;
  std::size_t cut_off_ = 0;
};

/// Which edit is in work; its id is empty while there is none.
class CurrentEdit {
 public:
  void set(std::string id) {
    const std::lock_guard lock(mutex_);
    id_ = std::move(id);
  }
  [[nodiscard]] std::string id() const {
    const std::lock_guard lock(mutex_);
    return id_;
  }

 private:
  mutable std::mutex mutex_;
  std::string id_;
};

/// What an answer comes to.
struct Heard {
  int status = 0;  ///< 0: there was no answer.
  std::string complaint;
};

Heard heard(const httplib::Result& result, const std::string& body) {
  if (!result) return {0, httplib::to_string(result.error())};
  return {result->status, std::to_string(result->status) + " " + body.substr(0, 200)};
}

Heard heard(const httplib::Result& result) { return heard(result, result ? result->body : std::string()); }

class LoadClient {
 public:
  LoadClient(const Options& options, const SceneExtent& extent, const CurrentEdit& edit,
             std::atomic<std::size_t>& cameras)
      : options_(options), extent_(extent), edit_(edit), cameras_(cameras), client_(connect(options)) {}

  void run_until(Clock::time_point end, std::size_t offset) {
    for (std::size_t n = offset; Clock::now() < end; ++n) {
      const Kind kind = nth_kind(n);
      const auto start = Clock::now();
      const Heard answer = ask(kind);
      const double ms = 1000 * seconds_since(start);
      if (options_.think_ms > 0)
        std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(options_.think_ms));
      if (answer.status > 0 && answer.status < 400) {
        tally_.milliseconds[kind].push_back(float(ms));
      } else {
        ++tally_.errors[kind];
        ++tally_.complaints[answer.complaint];
      }
    }
  }
  [[nodiscard]] const Tally& tally() const { return tally_; }

 private:
  /// Kinds in a fixed order that mixes them by their share.
  static Kind nth_kind(std::size_t n) {
    constexpr std::array<Kind, 10> order{poll, render, pick, poll, render, poll, render, pick, poll, render};
    static_assert(share[poll] + share[render] + share[pick] == int(order.size()));
    return order[n % order.size()];
  }

  Heard ask(Kind kind) {
    const std::string version = "/v1/scenes/" + options_.scene + "/versions/" + std::to_string(options_.version);
    if (kind == poll) return ask_edit();
    const json camera = new_camera(options_, extent_, cameras_++);
    if (kind == render)
      return heard(
          client_.Post(version + "/render", json{{"camera", camera}, {"format", "jpeg"}}.dump(), "application/json"));
    const json where{{"camera", camera}, {"x", options_.width / 2.0}, {"y", options_.height / 2.0}};
    return heard(client_.Post(version + "/pick", where.dump(), "application/json"));
  }

  Heard ask_edit() {
    const std::string id = edit_.id();
    const std::string path = id.empty() ? "/v1/edits?limit=10" : "/v1/edits/" + id;
    if (path != polled_) etag_.clear();
    polled_ = path;
    httplib::Headers headers;
    if (!etag_.empty()) headers.emplace("If-None-Match", etag_);
    bool same = false;
    const auto note = [&](const httplib::Response& response) {
      if (response.has_header("ETag")) etag_ = response.get_header_value("ETag");
      same = response.status == 304;
      return !same;  // httplib 0.11 would wait for the body of a 304, which has none; so it connects anew after each
    };
    std::string body;
    const auto result = client_.Get(path, headers, note, [&](const char* data, std::size_t size) {
      body.append(data, size);
      return true;
    });
    return same ? Heard{304, {}} : heard(result, body);
  }

  const Options& options_;
  const SceneExtent& extent_;
  const CurrentEdit& edit_;
  std::atomic<std::size_t>& cameras_;  ///< How many have been used.
  httplib::Client client_;
  std::string polled_, etag_;
  Tally tally_;
};

struct Edits {
  std::size_t succeeded = 0, others = 0;
  double seconds = 0;  ///< Of those that succeeded, from submission to result.
};

/// Edits, one after the other, while nobody else asks for anything: seconds of each.
double seconds_alone(const Options& options, const json& request) {
  auto client = connect(options);
  const auto start = Clock::now();
  for (int i = 0; i < options.alone; ++i) {
    const json accepted = expect_json(client.Post("/v1/edits", request.dump(), "application/json"), "the edit");
    const std::string path = accepted["links"]["self"];
    for (std::string state; state != "succeeded";) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      state = expect_json(client.Get(path), "the edit")["state"];
      if (state == "failed" || state == "cancelled") throw std::runtime_error("the edit " + state);
    }
  }
  return seconds_since(start) / options.alone;
}

/// Keeps an edit in work until the end; then cancels the one there is.
Edits keep_editing(const Options& options, const json& request, Clock::time_point end, CurrentEdit& current) {
  Edits edits;
  auto client = connect(options);
  while (Clock::now() < end) {
    const auto start = Clock::now();
    const json accepted = expect_json(client.Post("/v1/edits", request.dump(), "application/json"), "the edit");
    const std::string path = accepted["links"]["self"];
    current.set(accepted["id"]);
    std::string state;
    while (Clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      state = expect_json(client.Get(path), "the edit")["state"];
      if (state == "succeeded" || state == "failed" || state == "cancelled") break;
    }
    if (state == "succeeded") {
      ++edits.succeeded;
      edits.seconds += seconds_since(start);
    } else if (Clock::now() < end) {
      ++edits.others;
    } else {
      client.Post(path + "/cancel");
    }
  }
  return edits;
}

/// Resident memory of the service, MiB: from /proc where its id is given, else as it says itself.
std::optional<double> resident_mib(const Options& options, httplib::Client& client) {
  std::string text, key = "VmRSS:";
  double unit = 1024;
  if (options.pid > 0) {
    std::ifstream status("/proc/" + std::to_string(options.pid) + "/status");
    text.assign(std::istreambuf_iterator<char>(status), {});
  } else if (const auto metrics = client.Get("/metrics"); metrics && metrics->status == 200) {
    text = "\n" + metrics->body;
    key = "\nprocess_resident_memory_bytes ";
    unit = 1;
  }
  const auto at = text.find(key);
  if (at == std::string::npos) return std::nullopt;
  return std::stod(text.substr(at + key.size())) * unit / (1 << 20);
}

std::vector<double> watch_memory(const Options& options, Clock::time_point end) {
  std::vector<double> samples;
  auto client = connect(options);
  do {
    if (const auto now = resident_mib(options, client)) samples.push_back(*now);
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
  } while (Clock::now() < end);
  return samples;
}

/// Of sorted values; 0 of none.
float quantile(const std::vector<float>& sorted, double q) {
  return sorted.empty() ? 0 : sorted[std::size_t(std::lround(q * double(sorted.size() - 1)))];
}

std::string row(const std::vector<std::string>& cells, bool markdown) {
  constexpr std::array<int, 8> widths{18, 9, 8, 10, 10, 10, 10, 11};
  std::ostringstream out;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (markdown) {
      out << (i == 0 ? "| " : " ") << cells[i] << " |";
    } else {
      out << (i == 0 ? std::left : std::right) << std::setw(widths[i]) << cells[i];
    }
  }
  return out.str();
}

std::string fixed(double value, int digits) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(digits) << value;
  return out.str();
}

void print_waits(const std::vector<Tally>& tallies, double seconds, bool markdown) {
  std::cout << row({"request", "answers", "errors", "p50 ms", "p95 ms", "p99 ms", "max ms", "answers/s"}, markdown)
            << '\n';
  if (markdown) std::cout << "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";
  for (int kind = 0; kind < kinds; ++kind) {
    std::vector<float> all;
    std::size_t errors = 0;
    for (const Tally& tally : tallies) {
      const auto& own = tally.milliseconds[std::size_t(kind)];
      all.insert(all.end(), own.begin(), own.end());
      errors += tally.errors[std::size_t(kind)];
    }
    std::sort(all.begin(), all.end());
    std::cout << row({kind_names[std::size_t(kind)], std::to_string(all.size()), std::to_string(errors),
                      fixed(quantile(all, 0.5), 1), fixed(quantile(all, 0.95), 1), fixed(quantile(all, 0.99), 1),
                      fixed(quantile(all, 1), 1), fixed(double(all.size()) / seconds, 1)},
                     markdown)
              << '\n';
  }
}

void print_report(const Options& options, const std::vector<Tally>& tallies, const Edits& edits, double alone,
                  const std::vector<double>& memory, const Drippers& drippers, double seconds) {
  print_waits(tallies, seconds, options.markdown);
  std::cout << '\n'
            << options.clients << " clients"
            << (options.think_ms > 0 ? " that think for " + fixed(options.think_ms, 0) + " ms" : "") << ", "
            << fixed(seconds, 0) << " s, renders of " << options.width << "x" << options.height << ".\n";
  if (options.dripping > 0)
    std::cout << options.dripping << " clients dripped meanwhile; " << drippers.cut_off()
              << " times one was cut off, and came again.\n";
  if (!options.edit.empty())
    std::cout << "Edits meanwhile: " << edits.succeeded << " succeeded"
              << (edits.succeeded > 0 ? ", " + fixed(edits.seconds / double(edits.succeeded), 2) + " s each" : "")
              << "; " << edits.others << " did not.\n";
  if (alone > 0 && edits.succeeded > 0)
    std::cout << "Edits before that, alone: " << fixed(alone, 2) << " s each; under load they have "
              << fixed(100 * alone * double(edits.succeeded) / edits.seconds, 0) << " % of that speed.\n";
  if (!memory.empty())
    std::cout << "Resident memory of the service, MiB: " << fixed(memory.front(), 0) << " at the start, "
              << fixed(memory.back(), 0) << " at the end, " << fixed(*std::max_element(memory.begin(), memory.end()), 0)
              << " at most.\n";
  std::map<std::string, std::size_t> complaints;
  for (const Tally& tally : tallies)
    for (const auto& [text, count] : tally.complaints) complaints[text] += count;
  for (const auto& [text, count] : complaints) std::cerr << count << " times: " << text << '\n';
}

json read_edit(const Options& options) {
  std::ifstream file(options.edit);
  if (!file) throw std::runtime_error("cannot read " + options.edit);
  json request = json::parse(file);
  request["scene"] = options.scene;
  request["version"] = options.version;
  return request;
}

bool run(const Options& options) {
  const SceneExtent extent = find_extent(options);
  const json request = options.edit.empty() ? json() : read_edit(options);
  const double alone = options.alone > 0 && !options.edit.empty() ? seconds_alone(options, request) : 0;
  const auto start = Clock::now();
  const auto end = start + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.seconds));

  Drippers drippers(options);
  CurrentEdit current;
  Edits edits;
  std::vector<double> memory;
  std::string edit_failure;
  std::atomic<std::size_t> cameras{0};
  std::vector<std::unique_ptr<LoadClient>> clients;
  for (int i = 0; i < options.clients; ++i)
    clients.push_back(std::make_unique<LoadClient>(options, extent, current, cameras));
  {
    std::vector<std::jthread> threads;
    for (std::size_t i = 0; i < clients.size(); ++i) threads.emplace_back([&, i] { clients[i]->run_until(end, i); });
    threads.emplace_back([&] { drippers.drip_until(end); });
    threads.emplace_back([&] { memory = watch_memory(options, end); });
    if (!options.edit.empty())
      threads.emplace_back([&] {
        try {
          edits = keep_editing(options, request, end, current);
        } catch (const std::exception& failure) {
          edit_failure = failure.what();
        }
      });
  }
  const double seconds = seconds_since(start);
  std::vector<Tally> tallies;
  for (const auto& client : clients) tallies.push_back(client->tally());
  print_report(options, tallies, edits, alone, memory, drippers, seconds);
  if (!edit_failure.empty()) std::cerr << edit_failure << '\n';
  const bool clean =
      std::all_of(tallies.begin(), tallies.end(), [](const Tally& tally) { return tally.complaints.empty(); });
  return clean && edit_failure.empty() && edits.others == 0;
}

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): it ends a benchmark, with its message
int main(int argc, char** argv) {
  Options options;
  CLI::App program("Load on a running splatdrag service: many clients look, pick and poll while edits run.");
  program.add_option("--url", options.url, "Of the service")->capture_default_str();
  program.add_option("--scene", options.scene, "Id of the scene to look at")->required();
  program.add_option("--scene-version", options.version, "Its version")->capture_default_str();
  program.add_option("--clients", options.clients, "That ask at the same time")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  program.add_option("--seconds", options.seconds, "How long")->check(CLI::PositiveNumber)->capture_default_str();
  program.add_option("--dripping", options.dripping, "Connections that send a head without end, besides")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  program.add_option("--edit", options.edit, "Edit request (JSON) to keep in work all the while; its scene is --scene");
  program.add_option("--think", options.think_ms, "Milliseconds between an answer and a client's next request")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  program.add_option("--alone", options.alone, "Edits to carry out before the clients come, to compare with")
      ->check(CLI::Range(0, 1000));
  program.add_option("--pid", options.pid, "Process of the service, to read its memory from /proc; else from /metrics");
  program.add_option("--token", options.token, "Bearer token");
  program.add_option("--width", options.width, "Of the renders, pixels")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  program.add_option("--height", options.height, "Of the renders, pixels")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  program.add_flag("--markdown", options.markdown, "A table for docs/service-load.md");
  CLI11_PARSE(program, argc, argv);
  try {
    return run(options) ? 0 : 1;
  } catch (const std::exception& failure) {
    std::cerr << "error: " << failure.what() << '\n';
    return 2;
  }
}
