#include "server/http/log.h"

#include <spdlog/fmt/fmt.h>
#include <spdlog/formatter.h>
#include <spdlog/sinks/ostream_sink.h>

#include <algorithm>

#include "proto/log_entry.h"
#include "proto/time_text.h"

namespace server::http {
namespace {

/// spdlog carries one text: the message, then each field as a mark, 'n' (number) or 's', its name, '=', its value.
constexpr char field_mark = '\x1f';

std::string without_mark(std::string text) {
  std::replace(text.begin(), text.end(), field_mark, ' ');
  return text;
}

std::vector<proto::LogField> fields_of(std::string_view text) {
  std::vector<proto::LogField> fields;
  while (!text.empty()) {
    const std::string_view field = text.substr(0, text.find(field_mark));
    text.remove_prefix(std::min(field.size() + 1, text.size()));
    const std::size_t equals = field.find('=');
    if (equals == std::string_view::npos) continue;
    fields.push_back(
        {std::string(field.substr(1, equals - 1)), std::string(field.substr(equals + 1)), field.front() == 'n'});
  }
  return fields;
}

std::string as_text(const proto::LogEntry& entry) {
  std::string text = proto::rfc3339(entry.time) + ' ' + entry.level + ' ' + entry.message;
  for (const proto::LogField& field : entry.fields) text += ' ' + field.name + '=' + field.value;
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20; }, ' ');
  return text;
}

class Formatter : public spdlog::formatter {
 public:
  explicit Formatter(LogFormat format) : format_(format) {}

  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& to) override {
    const std::string_view payload(message.payload.data(), message.payload.size());
    const auto level = spdlog::level::to_string_view(message.level);
    const std::size_t mark = std::min(payload.find(field_mark), payload.size());
    const proto::LogEntry entry{std::chrono::floor<std::chrono::milliseconds>(message.time),
                                message.level == spdlog::level::warn ? "warn" : std::string(level.data(), level.size()),
                                std::string(payload.substr(0, mark)),
                                fields_of(payload.substr(std::min(mark + 1, payload.size())))};
    const std::string text = (format_ == LogFormat::json ? proto::to_json(entry) : as_text(entry)) + '\n';
    to.append(text.data(), text.data() + text.size());
  }

  [[nodiscard]] std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<Formatter>(format_);
  }

 private:
  LogFormat format_;
};

}  // namespace

engine::Result<std::shared_ptr<spdlog::logger>> make_logger(std::ostream& out, const std::string& level,
                                                            LogFormat format) {
  const auto parsed = spdlog::level::from_str(level);
  if (parsed == spdlog::level::off && level != "off")
    return engine::fail(engine::ErrorCode::invalid_argument,
                        "the log's level is one of debug, info, warn, error, off, not \"" + level + "\"");
  auto sink = std::make_shared<spdlog::sinks::ostream_sink_mt>(out, /*force_flush=*/true);
  auto logger = std::make_shared<spdlog::logger>("splatdrag", std::move(sink));
  logger->set_formatter(std::make_unique<Formatter>(format));
  logger->set_level(parsed);
  return logger;
}

void log(spdlog::logger& logger, spdlog::level::level_enum level, std::string_view message, LogFields fields) {
  if (!logger.should_log(level)) return;
  std::string payload = without_mark(std::string(message));
  for (const auto& [name, value] : fields) {
    const std::string* const text = std::get_if<std::string>(&value);
    payload += field_mark;
    payload += (text != nullptr ? 's' : 'n') + std::string(name) + '=';
    if (text != nullptr)
      payload += without_mark(*text);
    else
      std::visit([&](const auto& number) { payload += fmt::format("{}", number); }, value);
  }
  logger.log(level, spdlog::string_view_t(payload.data(), payload.size()));
}

}  // namespace server::http
