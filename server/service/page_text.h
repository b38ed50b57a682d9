// The page as it is sent: its sources without what only their readers need.
#pragma once

#include <string>
#include <string_view>

namespace server::service {

/// A script or style sheet without the comments that have lines of their own, and without indentation. Lines keep their
/// numbers, so that an error in a browser names the source's line. What is left is the same to a browser, as long as no
/// text in it goes over several lines (tests/web/unit/sources.test.mjs holds the page's sources to that).
///   name    the file's; anything but ".js" and ".css" stays as it is
[[nodiscard]] std::string page_text(std::string_view name, std::string_view source);

}  // namespace server::service
