#include "server/service/page_text.h"

#include <algorithm>

namespace server::service {

std::string page_text(std::string_view name, std::string_view source) {
  const bool is_script = name.ends_with(".js");
  if (!is_script && !name.ends_with(".css")) return std::string(source);
  std::string text;
  text.reserve(source.size());
  bool in_comment = false;
  while (!source.empty()) {
    const std::size_t end = source.find('\n');
    std::string_view line = source.substr(0, end);
    source.remove_prefix(end == std::string_view::npos ? source.size() : end + 1);
    line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
    const bool begins = !in_comment && line.starts_with("/*");
    if (in_comment || begins) {
      const std::size_t close = line.find("*/", begins ? 2 : 0);
      in_comment = close == std::string_view::npos;
      line.remove_prefix(in_comment ? line.size() : close + 2);  // what stands behind a comment is kept
    }
    if (!is_script || !line.starts_with("//")) text += line;
    if (end != std::string_view::npos) text += '\n';
  }
  return text;
}

}  // namespace server::service
