// The whole life of a service, over and over: scenes and datasets are uploaded, edited, looked at, downloaded and
// deleted again, for as long as is asked for. Prints whether memory, file descriptors, threads and disk stay level.
//
//     splatdrag serve --port 8080 --data-dir data &
//     soak --scene demo/scene.ply --dataset demo.zip --edit leaf.json --next-edit ball.json
//         --pid $! --data-dir data --minutes 60
//
// It waits between its steps: it looks for what grows, not for what is slow.
#include <httplib.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using nlohmann::json;

struct Options {
  std::string url = "http://127.0.0.1:8080", scene, dataset, edit, next_edit, token, data_dir;
  int pid = 0;
  double minutes = 60, pause = 2;
  bool markdown = false;
};

/// What the service takes at one moment, with nothing going on.
struct Sample {
  double minutes = 0;  ///< Since the beginning.
  double resident_mib = 0, descriptors = 0, threads = 0, disk_mib = 0;
};

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

std::string bytes_of(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + file);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// A field of /proc/<pid>/status.
double status_field(int pid, const std::string& field) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(field + ":")) return std::stod(line.substr(field.size() + 1));
  throw std::runtime_error("the service has ended");
}

double bytes_below(const fs::path& folder) {
  double sum = 0;
  std::error_code gone;  // files come and go while they are counted
  for (fs::recursive_directory_iterator entry(folder, gone), end; !gone && entry != end; entry.increment(gone))
    if (std::error_code error; entry->is_regular_file(error))
      if (const auto size = entry->file_size(error); !error) sum += double(size);
  return sum;
}

Sample sample_of(const Options& options, Clock::time_point start) {
  Sample sample;
  sample.minutes = seconds_since(start) / 60;
  sample.resident_mib = status_field(options.pid, "VmRSS") / 1024;
  sample.threads = status_field(options.pid, "Threads");
  const fs::directory_iterator descriptors("/proc/" + std::to_string(options.pid) + "/fd");
  sample.descriptors = double(std::distance(begin(descriptors), end(descriptors)));
  sample.disk_mib = bytes_below(options.data_dir) / (1 << 20);
  return sample;
}

/// One client, which does one thing after the other. An answer that is none of those that are expected ends the soak.
class Life {
 public:
  explicit Life(const Options& options)
      : options_(options),
        client_(options.url),
        scene_(bytes_of(options.scene)),
        edit_(json::parse(bytes_of(options.edit))),
        next_edit_(json::parse(bytes_of(options.next_edit))) {
    if (!options.dataset.empty()) dataset_ = bytes_of(options.dataset);
    client_.set_read_timeout(120);
    client_.set_tcp_nodelay(true);
    if (!options.token.empty()) client_.set_bearer_token_auth(options.token);
  }

  /// A scene from its upload to its deletion.
  void once() {
    const json scene = upload();
    const std::string id = scene["id"], self = "/v1/scenes/" + id;
    if (!dataset_.empty())
      expect(client_.Put(self + "/dataset", dataset_, "application/zip"), 200, "putting a dataset");
    std::vector<std::string> edits;
    edits.push_back(carry_out(id, edit_, 0, "draft"));
    edits.push_back(carry_out(id, next_edit_, 1, "preview"));
    edits.push_back(give_up(id));
    for (const int version : {0, 2}) look_at(self + "/versions/" + std::to_string(version), scene);
    preview(id);
    refuse_upload();
    for (const std::string& edit : edits) expect(client_.Delete("/v1/edits/" + edit), 204, "removing an edit");
    expect(client_.Delete(self), 204, "deleting a scene");
    pause();
  }

  [[nodiscard]] const std::map<std::string, std::size_t>& done() const { return done_; }

 private:
  void pause() const { std::this_thread::sleep_for(std::chrono::duration<double>(options_.pause)); }

  httplib::Response expect(httplib::Result result, int status, const std::string& what) {
    if (!result) throw std::runtime_error(what + ": " + httplib::to_string(result.error()));
    if (result->status != status)
      throw std::runtime_error(what + ": " + std::to_string(result->status) + " " + result->body.substr(0, 500));
    ++done_[what];
    return std::move(*result);
  }

  json upload() {
    pause();
    return json::parse(
        expect(client_.Post("/v1/scenes?name=soak", scene_, "application/octet-stream"), 201, "uploading a scene")
            .body);
  }

  std::string submit(const std::string& scene, json request, int version, const std::string& preset) {
    pause();
    request["scene"] = scene, request["version"] = version, request["preset"] = preset;
    if (preset != "preview") request["params"]["iterations"] = 40;
    return json::parse(
        expect(client_.Post("/v1/edits", request.dump(), "application/json"), 202, "an edit").body)["id"];
  }

  std::string state_of(const std::string& edit) {
    return json::parse(expect(client_.Get("/v1/edits/" + edit), 200, "a poll of an edit").body)["state"];
  }

  std::string wait_for_end(const std::string& edit) {
    for (;;) {
      const std::string state = state_of(edit);
      if (state == "succeeded" || state == "failed" || state == "cancelled") return state;
      std::this_thread::sleep_for(std::chrono::milliseconds(250));
    }
  }

  std::string carry_out(const std::string& scene, const json& request, int version, const std::string& preset) {
    const std::string id = submit(scene, request, version, preset);
    if (const std::string state = wait_for_end(id); state != "succeeded") throw std::runtime_error(id + " " + state);
    expect(client_.Get("/v1/edits/" + id + "/intervals/1/renders/0?stage=deformed"), 200, "a picture of an interval");
    return id;
  }

  /// An edit that is cancelled somewhere.
  std::string give_up(const std::string& scene) {
    const std::string id = submit(scene, edit_, 0, "draft");
    std::this_thread::sleep_for(std::chrono::milliseconds(50 * (done_["an edit"] % 7)));
    const auto cancelled = client_.Post("/v1/edits/" + id + "/cancel");
    if (!cancelled || (cancelled->status != 200 && cancelled->status != 409))
      throw std::runtime_error("cancelling " + id);
    ++done_["a cancellation"];
    (void)wait_for_end(id);
    return id;
  }

  void look_at(const std::string& version, const json& scene) {
    pause();
    const json camera{{"eye",
                       {scene["centre"][0].get<double>() + 3 * scene["radius"].get<double>(), scene["centre"][1],
                        scene["centre"][2]}},
                      {"target", scene["centre"]},
                      {"fov_y_deg", 50},
                      {"width", 480},
                      {"height", 270}};
    const json order{{"camera", camera}, {"format", "jpeg"}};
    expect(client_.Post(version + "/render", order.dump(), "application/json"), 200, "a render");
    for (const char* format : {"ply", "spz"})
      expect(client_.Get(version + "/file?format=" + format), 200, "a download");
  }

  void preview(const std::string& scene) {
    json request = edit_;
    request["scene"] = scene, request["version"] = 0;
    expect(client_.Post("/v1/previews", request.dump(), "application/json"), 200, "a preview");
  }

  /// Half a scene is none.
  void refuse_upload() {
    pause();
    const std::string half = scene_.substr(0, scene_.size() / 2);
    expect(client_.Post("/v1/scenes", half, "application/octet-stream"), 422, "a refused upload");
  }

  const Options& options_;
  httplib::Client client_;
  std::string scene_, dataset_;
  json edit_, next_edit_;
  std::map<std::string, std::size_t> done_;
};

std::string fixed(double value, int digits) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(digits) << value;
  return out.str();
}

/// A line for each tenth of the time: what was taken at most.
void print(const Options& options, const std::vector<Sample>& samples) {
  constexpr int parts = 10;
  const char* const before = options.markdown ? "| " : "";
  const char* const between = options.markdown ? " | " : "\t";
  const char* const after = options.markdown ? " |\n" : "\n";
  const auto row = [&](const std::array<std::string, 6>& cells) {
    std::cout << before;
    for (std::size_t i = 0; i < cells.size(); ++i) std::cout << (i > 0 ? between : "") << cells[i];
    std::cout << after;
  };
  row({"minutes", "lives", "resident, MiB", "descriptors", "threads", "disk, MiB"});
  if (options.markdown) std::cout << "| ---: | ---: | ---: | ---: | ---: | ---: |\n";
  const double whole = samples.back().minutes;
  for (int part = 0; part < parts; ++part) {
    const double from = whole * part / parts, to = whole * (part + 1) / parts;
    Sample most;
    std::size_t count = 0;
    for (const Sample& each : samples) {
      if (each.minutes < from || (each.minutes >= to && part + 1 < parts)) continue;
      ++count;
      most.resident_mib = std::max(most.resident_mib, each.resident_mib);
      most.descriptors = std::max(most.descriptors, each.descriptors);
      most.threads = std::max(most.threads, each.threads);
      most.disk_mib = std::max(most.disk_mib, each.disk_mib);
    }
    if (count > 0)
      row({fixed(from, 0) + " to " + fixed(to, 0), std::to_string(count), fixed(most.resident_mib, 0),
           fixed(most.descriptors, 0), fixed(most.threads, 0), fixed(most.disk_mib, 2)});
  }
}

void run(const Options& options) {
  const auto start = Clock::now();
  Life life(options);
  std::vector<Sample> samples;
  do {
    life.once();
    samples.push_back(sample_of(options, start));
    std::cerr << fixed(samples.back().minutes, 1) << " min: " << fixed(samples.back().resident_mib, 0) << " MiB, "
              << samples.back().descriptors << " descriptors, " << fixed(samples.back().disk_mib, 2)
              << " MiB on disk\n";
  } while (seconds_since(start) < 60 * options.minutes);
  print(options, samples);
  std::cout << '\n';
  for (const auto& [what, count] : life.done()) std::cout << count << " times: " << what << '\n';
}

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): it ends a benchmark, with its message
int main(int argc, char** argv) {
  Options options;
  CLI::App program("Lives of scenes on a running splatdrag service, one after the other: does anything grow?");
  program.add_option("--url", options.url, "Of the service")->capture_default_str();
  program.add_option("--scene", options.scene, "Scene file to upload")->required()->check(CLI::ExistingFile);
  program.add_option("--dataset", options.dataset, "Zip file of its dataset")->check(CLI::ExistingFile);
  program.add_option("--edit", options.edit, "Edit request (JSON)")->required()->check(CLI::ExistingFile);
  program.add_option("--next-edit", options.next_edit, "Another one, of what the first has made")
      ->required()
      ->check(CLI::ExistingFile);
  program.add_option("--pid", options.pid, "Process of the service")->required();
  program.add_option("--data-dir", options.data_dir, "Its data folder")->required()->check(CLI::ExistingDirectory);
  program.add_option("--minutes", options.minutes, "How long")->check(CLI::PositiveNumber)->capture_default_str();
  program.add_option("--pause", options.pause, "Seconds between steps")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  program.add_option("--token", options.token, "Bearer token");
  program.add_flag("--markdown", options.markdown, "A table for docs/service-load.md");
  CLI11_PARSE(program, argc, argv);
  try {
    run(options);
    return 0;
  } catch (const std::exception& failure) {
    std::cerr << "error: " << failure.what() << '\n';
    return 1;
  }
}
