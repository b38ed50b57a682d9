// Slows down whoever tries tokens.
#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <mutex>
#include <optional>
#include <string>

namespace server::http {

/// How much guessing is borne. All of it is a choice: a person who mistypes a token notices nothing, a program gets a
/// guess a minute.
struct GuessBrakeOptions {
  int free_guesses = 5;                       ///< Wrong tokens in a row that cost nothing.
  std::chrono::seconds first_wait{1};         ///< After one more; doubled by each that follows,
  std::chrono::seconds longest_wait{60};      ///< up to this.
  std::chrono::seconds forgotten_after{600};  ///< Without a wrong token.
  std::size_t max_addresses = 4096;           ///< Remembered; the one quiet for longest makes room.
};

/// Wrong tokens by the address they came from. Safe to call from any thread.
class GuessBrake {
 public:
  using Clock = std::chrono::steady_clock;

  explicit GuessBrake(const GuessBrakeOptions& options = {}) : options_(options) {}

  /// Whole seconds until a token from this address is looked at again; none: at once.
  [[nodiscard]] std::optional<int> must_wait(const std::string& address, Clock::time_point now = Clock::now()) const;
  ///   token  the wrong one; the same as the one before is no guess, but a program that was set up wrong
  void count_wrong(const std::string& address, const std::string& token, Clock::time_point now = Clock::now());
  void forget(const std::string& address);
  [[nodiscard]] std::size_t addresses() const;

 private:
  struct Guesses {
    int wrong = 0;
    std::size_t last_token = 0;  ///< Its hash.
    Clock::time_point last, until;
  };

  const GuessBrakeOptions options_;
  mutable std::mutex mutex_;
  std::map<std::string, Guesses> by_network_;
};

}  // namespace server::http
