// Typed fields of JSON that nobody has checked yet. For the .cc files of this room and of engine/weights.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "engine/core/result.h"
#include "engine/core/vec.h"

namespace engine::io {

/// A JSON value and its address. The first thing that is not as asked for becomes the document's error; from then on
/// every answer is zero or empty, so a parser reads several fields and asks for the error once, before it believes
/// them.
class JsonFields {
 public:
  /// value, error: outlive this object and all that at() gives.
  JsonFields(const nlohmann::json& value, std::string where, std::optional<Error>& error)
      : value_(&value), where_(std::move(where)), error_(&error) {}

  [[nodiscard]] const std::string& where() const { return where_; }
  [[nodiscard]] bool has(const char* key) const { return value_->is_object() && value_->contains(key); }

  [[nodiscard]] bool has_value(const char* key) const { return has(key) && !(*value_)[key].is_null(); }
  [[nodiscard]] bool is_array() const { return value_->is_array(); }
  [[nodiscard]] bool is_boolean() const { return value_->is_boolean(); }
  [[nodiscard]] bool is_number() const { return value_->is_number(); }
  [[nodiscard]] bool is_string() const { return value_->is_string(); }

  [[nodiscard]] JsonFields at(const char* key) const {
    if (!value_->is_object()) note("an object");
    JsonFields member(has(key) ? (*value_)[key] : nothing(), where_ + separator() + key, *error_);
    if (!has(key)) member.fail_here("this field is missing");
    return member;
  }
  [[nodiscard]] JsonFields at(std::size_t index) const {  // index < size()
    return {index < size() ? (*value_)[index] : nothing(), where_ + "[" + std::to_string(index) + "]", *error_};
  }

  /// Elements of an array.
  [[nodiscard]] std::size_t size() const {
    if (value_->is_array()) return value_->size();
    note("an array");
    return 0;
  }
  [[nodiscard]] double number() const {
    // The JSON grammar has no NaN and no infinity, and the parser refuses what overflows a double.
    if (value_->is_number()) return value_->get<double>();
    note("a number");
    return 0;
  }
  /// A number of pixels. Some tools write 1080.0.
  [[nodiscard]] int pixels() const {
    const double value = number();
    if (value >= 1 && value <= 0x7fffffff && value == std::floor(value)) return int(value);
    note("a whole number of pixels");
    return 0;
  }
  [[nodiscard]] bool boolean() const {
    if (value_->is_boolean()) return value_->get<bool>();
    note("true or false");
    return false;
  }
  [[nodiscard]] std::string string() const {
    if (value_->is_string()) return value_->get<std::string>();
    note("a string");
    return {};
  }
  /// `count` numbers.
  void numbers(double* out, std::size_t count) const {
    std::fill_n(out, count, 0.0);
    if (size() != count) return note("an array of " + std::to_string(count) + " numbers");
    for (std::size_t i = 0; i < count; ++i) out[i] = at(i).number();
  }
  void fail_here(std::string message) const {
    if (!*error_) *error_ = Error{ErrorCode::corrupt_data, std::move(message), where_};
  }

 private:
  static const nlohmann::json& nothing() {
    static const nlohmann::json null;
    return null;
  }
  // The document itself has the address "transforms.json:", its members follow without a dot.
  [[nodiscard]] const char* separator() const { return where_.ends_with(':') ? "" : "."; }
  void note(const std::string& expected) const { fail_here("expected " + expected + ", found " + value_->type_name()); }

  const nlohmann::json* value_;
  std::string where_;
  std::optional<Error>* error_;
};

/// Most bytes that the document takes as a tree, its text included. "{}," is 3 bytes of text and 150 of tree; counted
/// are places in arrays while they grow, nodes of objects, and strings.
[[nodiscard]] inline std::uint64_t json_tree_bytes(std::span<const std::byte> bytes) {
  std::uint64_t commas = 0, openings = 0, quotes = 0;
  for (const std::byte byte : bytes) {
    const char c = char(byte);
    commas += c == ',' ? 1 : 0;
    openings += c == '{' || c == '[' ? 1 : 0;
    quotes += c == '"' ? 1 : 0;
  }
  return bytes.size() + 96 * commas + 160 * openings + 32 * quotes;
}

/// The document, or the place where it stops being JSON.
[[nodiscard]] inline Result<nlohmann::json> parse_json(std::span<const std::byte> bytes, const std::string& file) {
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  try {
    return nlohmann::json::parse(text, text + bytes.size());
  } catch (const nlohmann::json::parse_error& failure) {
    return fail(ErrorCode::corrupt_data, "not valid JSON: it goes wrong at byte " + std::to_string(failure.byte), file);
  } catch (const nlohmann::json::exception&) {
    return fail(ErrorCode::corrupt_data, "not valid JSON: a number is too large to be represented", file);
  }
}

/// The rotation nearest to a matrix that was printed as one, to a few digits perhaps; nothing if it is none: scaled,
/// sheared or mirrored.
[[nodiscard]] inline std::optional<DMat3> as_rotation(const DMat3& m) {
  const DMat3 residue = glm::transpose(m) * m - DMat3(1.0);
  double worst = 0;
  for (int i = 0; i < 3; ++i) worst = std::fmax(worst, glm::length(residue[i]));
  if (!(worst < 1e-2 && glm::determinant(m) > 0)) return std::nullopt;
  return glm::mat3_cast(glm::normalize(glm::quat_cast(m)));
}

}  // namespace engine::io
