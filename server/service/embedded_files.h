// Files that are part of the program (cmake/Embed.cmake puts them in).
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

namespace server::service {

/// Lives as long as the program.
struct EmbeddedFile {
  std::string_view name;  ///< Path below its folder: "index.html", "icons/drag.svg".
  std::string_view bytes;
  std::string_view gzip;  ///< The same, compressed; empty: not at hand.
};

/// The page: what lies below web/.
[[nodiscard]] std::vector<EmbeddedFile> page_files();

/// The contract: openapi.yaml.
[[nodiscard]] std::vector<EmbeddedFile> contract_files();

}  // namespace server::service
