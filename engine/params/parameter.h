// What the table in params.h says about a parameter.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/params/choices.h"

namespace engine::params {

/// Which part of an edit a parameter has an effect on.
enum class Part {
  motion,        ///< Where Gaussians go: what a preview shows.
  views,         ///< The pictures it looks through.
  correction,    ///< What the corrector makes of them.
  diffusion,     ///< How the corrector `sd` does it; without effect on others.
  optimisation,  ///< How the Gaussians are brought to look like that.
};
constexpr auto names_of(Part) {
  return std::array{Name{Part::motion, "motion"}, Name{Part::views, "views"}, Name{Part::correction, "correction"},
                    Name{Part::diffusion, "diffusion"}, Name{Part::optimisation, "optimisation"}};
}

/// The values a parameter may have: of enumerations, booleans and seeds, all.
template <class T>
struct Range {};

template <>
struct Range<int> {
  int low = 0, high = 0;
  std::string_view zero{};  ///< Not empty: 0 is a value too, though not on the wire. It means: to ...
};

template <>
struct Range<double> {
  double low = 0, high = 0;
};

template <>
struct Range<std::vector<std::string>> {
  std::size_t most = 0;  ///< Most elements.
};

/// What a parameter is if nobody gives it.
template <class T>
struct Defaults {
  T usual{};  ///< Without a preset, and with one that is not named here.
  std::optional<T> preview{}, draft{}, standard{}, paper{};

  [[nodiscard]] constexpr const T& of(Preset preset) const {
    const std::optional<T>* own = nullptr;
    switch (preset) {
      case Preset::preview:
        own = &preview;
        break;
      case Preset::draft:
        own = &draft;
        break;
      case Preset::standard:
        own = &standard;
        break;
      case Preset::paper:
        own = &paper;
        break;
    }
    return own != nullptr && *own ? **own : usual;
  }
};

}  // namespace engine::params
