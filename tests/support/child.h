// A child process, and words of one letter between it and its parent.
#pragma once

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <exception>
#include <functional>
#include <stdexcept>

namespace support {

/// Runs a function in a process of its own, made by fork(): whoever makes it has no other threads.
class Child {
 public:
  explicit Child(const std::function<void(const Child&)>& body) {
    if (::pipe2(up_, O_CLOEXEC) != 0 || ::pipe2(down_, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    process_ = ::fork();
    if (process_ == 0) ::_exit(run(body));
    ::close(up_[1]);
    ::close(down_[0]);
  }
  ~Child() {
    ::close(up_[0]);
    ::close(down_[1]);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// In the child.
  void say(char word) const {
    if (::write(up_[1], &word, 1) != 1) ::_exit(3);
  }
  /// In the child: waits for what the parent tells it next.
  char listen() const {
    char word = 0;
    return ::read(down_[0], &word, 1) == 1 ? word : char(0);
  }
  /// In the parent: what the child has said next; 0 if it has ended.
  [[nodiscard]] char hear() const {
    char word = 0;
    return ::read(up_[0], &word, 1) == 1 ? word : char(0);
  }
  void tell(char word) const { (void)!::write(down_[1], &word, 1); }
  void signal(int number) const { ::kill(process_, number); }
  void kill() const { signal(SIGKILL); }
  /// Waits for its end: the status that waitpid() tells.
  [[nodiscard]] int end() const {
    int status = 0;
    ::waitpid(process_, &status, 0);
    return status;
  }
  /// Whether it ended by itself, without complaint.
  [[nodiscard]] bool ended_well() const {
    const int status = end();
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }

 private:
  int run(const std::function<void(const Child&)>& body) const {
    try {
      body(*this);
      return 0;
    } catch (const std::exception& e) {
      std::fprintf(stderr, "child: %s\n", e.what());
      return 1;
    }
  }

  int up_[2], down_[2];
  pid_t process_;
};

}  // namespace support
