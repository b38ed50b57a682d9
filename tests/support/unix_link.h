// What lies between a client and the server's socket, to be cut at the worst moment.
#pragma once

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

namespace support {

/// Listens on one socket and passes on to another. Once told to, it passes on the next text that has a given word in
/// it, lets the other side answer, and cuts all there is before the answer gets through. It does so, too, where a side
/// ends.
class UnixLink {
 public:
  UnixLink(const std::filesystem::path& from, std::filesystem::path to) : to_(std::move(to)), listener_(bound(from)) {
    thread_ = std::thread([this] { loop(); });
  }
  ~UnixLink() {
    ends_ = true;
    thread_.join();
    cut();
    ::close(listener_);
  }
  UnixLink(const UnixLink&) = delete;
  UnixLink& operator=(const UnixLink&) = delete;

  /// Before the answer to the next text with this word; empty: never.
  void cut_after(const std::string& word) {
    word_ = word;
    is_armed_ = !word.empty();
  }
  [[nodiscard]] int cuts() const { return cuts_; }

 private:
  struct Pair {
    int client, server;
    bool loses_answer = false;
  };

  static sockaddr_un address_of(const std::filesystem::path& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    return address;
  }
  static int bound(const std::filesystem::path& path) {
    const int made = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_un address = address_of(path);
    if (::bind(made, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 || ::listen(made, 8) != 0)
      throw std::runtime_error("cannot listen on " + path.string());
    return made;
  }

  void loop() {
    while (!ends_)
      if (!step()) cut();
  }
  /// Whether the link holds.
  bool step() {
    std::vector<pollfd> files{{listener_, POLLIN, 0}};
    for (const Pair& pair : pairs_) {
      files.push_back({pair.client, POLLIN, 0});
      files.push_back({pair.server, POLLIN, 0});
    }
    constexpr int look_up_ms = 10;
    if (::poll(files.data(), files.size(), look_up_ms) <= 0) return true;
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      if (files[2 * i + 1].revents != 0 && !pass_on(pairs_[i], /*from_client=*/true)) return false;
      if (files[2 * i + 2].revents != 0 && !pass_on(pairs_[i], /*from_client=*/false)) return false;
    }
    return files.front().revents == 0 || accept_one();
  }
  /// Whether somebody listens at the other end.
  bool accept_one() {
    const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    const int server = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_un address = address_of(to_);
    pairs_.push_back({client, server});
    return ::connect(server, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  bool pass_on(Pair& pair, bool from_client) {
    char bytes[65536];
    const auto count = ::read(from_client ? pair.client : pair.server, bytes, sizeof bytes);
    if (count <= 0) return false;
    if (from_client && is_armed_ && std::string_view(bytes, std::size_t(count)).find(word_) != std::string_view::npos) {
      is_armed_ = false;
      pair.loses_answer = true;
    } else if (pair.loses_answer) {
      ++cuts_;
      return false;
    }
    return ::write(from_client ? pair.server : pair.client, bytes, std::size_t(count)) == count;
  }
  void cut() {
    for (const Pair& pair : pairs_) {
      ::close(pair.client);
      ::close(pair.server);
    }
    pairs_.clear();
  }

  std::filesystem::path to_;
  int listener_;
  std::vector<Pair> pairs_;
  std::string word_;  ///< Written before `is_armed_` is set, read once it is.
  std::atomic<bool> is_armed_ = false, ends_ = false;
  std::atomic<int> cuts_ = 0;
  std::thread thread_;
};

}  // namespace support
