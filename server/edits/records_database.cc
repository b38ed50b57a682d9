#include "server/edits/records_database.h"

#include <unistd.h>

#include <array>
#include <random>
#include <string_view>
#include <system_error>
#include <utility>

#include "engine/jobs/durable_file.h"

namespace server::edits {
namespace {

namespace fs = std::filesystem;
namespace jobs = engine::jobs;
using engine::propagate;
using engine::Result;

constexpr std::string_view hex_digits = "0123456789abcdef";
constexpr std::size_t id_length = 32;

Result<void> make_id(const fs::path& folder) {
  std::random_device random;
  std::string id;
  while (id.size() < id_length) id += hex_digits[random() % hex_digits.size()];
  if (auto made = jobs::create_folder(folder); !made) return made;
  return jobs::write_durably(folder / folder_id_name, id);
}

std::string name_of_this_host() {
  std::array<char, 256> name{};  // the last byte stays 0
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

}  // namespace

bool is_in_database(const fs::path& folder) {
  std::error_code error;
  return fs::exists(folder / folder_id_name, error);
}

std::string this_process() { return name_of_this_host() + ":" + std::to_string(::getpid()); }

Result<jobs::PostgresOptions> database_of(const fs::path& folder, const std::string& address) {
  if (!is_in_database(folder))
    if (auto made = make_id(folder); !made) return propagate(made);
  auto id = jobs::read_bytes(folder / folder_id_name);
  if (!id) return propagate(id);
  if (id->size() != id_length || id->find_first_not_of(hex_digits) != std::string::npos)
    return engine::fail(engine::ErrorCode::corrupt_data,
                        "the name by which the database knows this data folder is damaged", folder / folder_id_name);
  std::error_code error;
  const fs::path data = fs::absolute(folder, error).parent_path();
  return jobs::PostgresOptions{.address = address,
                               .owner = std::move(*id),
                               .owner_for_people = "data folder " + name_of_this_host() + ":" + data.string()};
}

}  // namespace server::edits
