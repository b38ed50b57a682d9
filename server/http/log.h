// The service's log: one line per request and per event, for machines (JSON) or people.
#pragma once

#include <spdlog/logger.h>

#include <cstdint>
#include <initializer_list>
#include <iosfwd>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "engine/core/result.h"

namespace server::http {

enum class LogFormat { json, text };

/// A logger that writes to `out`, which outlives it. Whatever is logged with it becomes one line:
///   json  {"time":"2026-11-21T11:09:38.123Z","level":"info","message":"...", ...}
///   text  2026-11-21T11:09:38.123Z info ... name=value
///   level   "debug", "info", "warn", "error", "off"
///   errors  invalid_argument: no such level
[[nodiscard]] engine::Result<std::shared_ptr<spdlog::logger>> make_logger(std::ostream& out, const std::string& level,
                                                                          LogFormat format);

using LogValue = std::variant<std::string, std::int64_t, double>;
using LogFields = std::initializer_list<std::pair<std::string_view, LogValue>>;

/// Logs an event with values beside its message. Neither secrets nor query strings belong in them.
void log(spdlog::logger& logger, spdlog::level::level_enum level, std::string_view message, LogFields fields = {});

}  // namespace server::http
