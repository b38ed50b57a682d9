// Reading a request out of a JSON document, strictly.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/names.h"
#include "proto/wire.h"

namespace proto {

using engine::Name;

/// A value of a JSON document with its address. The first failure in a document is noted in `error`, which its fields
/// share; after one, reading goes on with harmless values.
class JsonField {
 public:
  JsonField(const nlohmann::json& value, std::string where, std::optional<engine::Error>& error)
      : value_(&value), where_(std::move(where)), error_(&error) {}

  /// A finite number, low <= x <= high.
  [[nodiscard]] double number(double low, double high) const;
  /// A number above 0, at most max_coordinate.
  [[nodiscard]] double length() const;
  /// A whole number, low <= x <= high.
  [[nodiscard]] int whole(int low, int high) const;
  [[nodiscard]] std::uint64_t unsigned_number() const;
  [[nodiscard]] bool boolean() const;
  [[nodiscard]] std::string text(std::size_t max_bytes = max_text_bytes) const;
  [[nodiscard]] Point point() const;  ///< Three coordinates within max_coordinate.
  [[nodiscard]] Point edges() const;  ///< Three length()s.
  /// N numbers, each low <= x <= high.
  template <std::size_t N>
  [[nodiscard]] std::array<double, N> numbers(double low, double high) const;
  template <class E, std::size_t N>
  [[nodiscard]] E one_of(const std::array<Name<E>, N>& names) const;
  /// The elements of an array of low to high of `things`.
  [[nodiscard]] std::vector<JsonField> elements(std::size_t low, std::size_t high, const std::string& things) const;

  [[nodiscard]] bool is_object() const { return value_->is_object(); }
  [[nodiscard]] bool is_null() const { return value_->is_null(); }
  [[nodiscard]] const std::string& where() const { return where_; }
  /// Notes a failure here, unless one has been noted before.
  void refuse(std::string message) const;

 private:
  friend class Members;

  void expected(const std::string& what) const;

  const nlohmann::json* value_;
  std::string where_;
  std::optional<engine::Error>* error_;
};

/// The members of an object; those not in `known` are refused at once.
class Members {
 public:
  Members(const JsonField& object, std::span<const std::string_view> known);
  Members(const JsonField& object, std::initializer_list<std::string_view> known)
      : Members(object, std::span(known.begin(), known.size())) {}

  /// Refuses the object if the member is missing.
  [[nodiscard]] std::optional<JsonField> required(std::string_view name) const;
  [[nodiscard]] std::optional<JsonField> optional(std::string_view name) const;

 private:
  [[nodiscard]] std::string address(std::string_view name) const;

  JsonField object_;
};

template <std::size_t N>
std::array<double, N> JsonField::numbers(double low, double high) const {
  std::array<double, N> values{};
  const auto fields = elements(N, N, "numbers");
  for (std::size_t i = 0; i < fields.size(); ++i) values[i] = fields[i].number(low, high);
  return values;
}

template <class E, std::size_t N>
E JsonField::one_of(const std::array<Name<E>, N>& names) const {
  if (value_->is_string())
    for (const Name<E>& name : names)
      if (value_->get_ref<const std::string&>() == name.text) return name.value;
  std::string choices;
  for (const Name<E>& name : names) choices += (choices.empty() ? "\"" : ", \"") + std::string(name.text) + '"';
  expected("one of " + choices);
  return names.front().value;
}

}  // namespace proto
