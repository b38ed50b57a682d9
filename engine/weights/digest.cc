#include "engine/weights/digest.h"

#include <xxhash.h>

#include <cstdint>
#include <cstdio>
#include <new>

namespace engine::weights {

struct Digest::State {
  XXH3_state_t* stream = XXH3_createState();
  State() {
    if (stream == nullptr) throw std::bad_alloc();
    XXH3_64bits_reset(stream);
  }
  ~State() { XXH3_freeState(stream); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
};

Digest::Digest() : state_(std::make_unique<State>()) {}
Digest::~Digest() = default;
Digest::Digest(Digest&&) noexcept = default;
Digest& Digest::operator=(Digest&&) noexcept = default;

void Digest::add(std::span<const std::byte> bytes) {
  const std::uint64_t size = bytes.size();
  XXH3_64bits_update(state_->stream, &size, sizeof size);
  XXH3_64bits_update(state_->stream, bytes.data(), bytes.size());
}

void Digest::add(std::string_view name, const StoredTensor& tensor) {
  add(name);
  add(tensor.dtype);
  add(text_of(tensor.shape));
  add(tensor.bytes);
}

std::string Digest::text() const {
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(XXH3_64bits_digest(state_->stream)));
  return digits;
}

}  // namespace engine::weights
