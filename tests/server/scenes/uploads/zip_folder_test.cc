#include "server/scenes/uploads/zip_folder.h"

#include "tests/server/scenes/store_support.h"

namespace server::scenes {
namespace {

struct ZipFolder : testing::Test {
  support::TempDir temp;
  fs::path zip = temp.path() / "in.zip", out = temp.path() / "out";
  ZipLimits limits;

  ZipFolder() { fs::create_directories(out); }
  Result<void> unpack(const std::vector<Zipped>& entries) {
    write_zip(zip, entries);
    return unzip(zip, "data.zip", out, limits);
  }
  void expect_refused(const std::vector<Zipped>& entries, ErrorCode code, const std::string& where) {
    const auto done = unpack(entries);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, code) << done.error().message;
    EXPECT_EQ(done.error().where, where);
  }
};

TEST_F(ZipFolder, UnpacksFilesAndFolders) {
  ASSERT_TRUE(unpack({{"a.txt", "one"}, {"sub/deep/b.txt", "two"}, {"./c.txt", "three"}, {"win\\d.txt", "four"}}));
  EXPECT_EQ(support::read_file(out / "a.txt"), "one");
  EXPECT_EQ(support::read_file(out / "sub/deep/b.txt"), "two");
  EXPECT_EQ(support::read_file(out / "c.txt"), "three");
  EXPECT_EQ(support::read_file(out / "win/d.txt"), "four");
}

TEST_F(ZipFolder, RefusesNamesThatLeadOut) {
  for (const char* name : {"../evil", "a/../../evil", "/etc/evil", "..\\evil", "C:\\evil", "C:evil", "a/..", "\\evil"})
    expect_refused({{name, "x"}}, ErrorCode::invalid_argument, std::string("data.zip:") + name);
  EXPECT_FALSE(fs::exists(temp.path() / "evil"));
}

TEST_F(ZipFolder, RefusesControlCharactersAndDoesNotRepeatThem) {
  expect_refused({{"a\nb", "x"}}, ErrorCode::invalid_argument, "data.zip:a?b");
}

TEST_F(ZipFolder, RefusesLinks) {
  expect_refused({{"link", "/etc/passwd", true}}, ErrorCode::invalid_argument, "data.zip:link");
  EXPECT_TRUE(fs::is_empty(out));
}

TEST_F(ZipFolder, RefusesEncryptedEntries) {
  expect_refused({{"secret", "x", false, true}}, ErrorCode::unsupported, "data.zip:secret");
}

TEST_F(ZipFolder, RefusesTwoEntriesOfOneName) {
  expect_refused({{"a", "x"}, {"./a", "y"}}, ErrorCode::corrupt_data, "data.zip:./a");
  expect_refused({{"f", "x"}, {"f/g", "y"}}, ErrorCode::corrupt_data, "data.zip:f/g");
}

TEST_F(ZipFolder, RefusesMoreFilesThanTheLimit) {
  limits.max_files = 2;
  expect_refused({{"a", "x"}, {"b", "x"}, {"c", "x"}}, ErrorCode::too_large, "data.zip");
}

TEST_F(ZipFolder, CountsTheFoldersThatALongNameImplies) {
  limits.max_files = 10;
  EXPECT_TRUE(unpack({{"a/b/c/d/e/f/g/h/i", "x"}}));
  fs::remove_all(out / "a");
  expect_refused({{"a/b/c/d/e/f/g/h/i/j", "x"}, {"k/l", "x"}}, ErrorCode::too_large, "data.zip");
}

TEST_F(ZipFolder, RefusesDeepFolders) {
  std::string name;
  for (int i = 0; i < 32; ++i) name += "d/";
  EXPECT_TRUE(unpack({{name + "file", "x"}}));
  expect_refused({{name + "d/file", "x"}}, ErrorCode::too_large, "data.zip:" + name + "d/file");
}

/// An end record that promises a directory, and the record of large files before it if `large`.
std::string end_of_zip(std::uint64_t entries, std::uint64_t directory_bytes, bool large) {
  std::string bytes;
  const auto append = [&](std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes += char(value >> 8 * i & 0xff);
  };
  if (large) {
    bytes += "PK\x06\x06";
    append(44, 8), append(45, 2), append(45, 2), append(0, 8);
    append(entries, 8), append(entries, 8), append(directory_bytes, 8), append(0, 8);
    bytes += "PK\x06\x07";
    append(0, 4), append(0, 8), append(1, 4);
  }
  bytes += "PK\x05\x06";
  append(0, 4);
  append(large ? 0xffff : entries, 2), append(large ? 0xffff : entries, 2);
  append(large ? 0xffffffff : directory_bytes, 4), append(0, 4), append(0, 2);
  return bytes;
}

TEST_F(ZipFolder, RefusesALargeDirectoryBeforeItIsLoaded) {
  for (const std::string& end :
       {end_of_zip(60'000, 60, false), end_of_zip(3, 500'000'000, false), end_of_zip(std::uint64_t{1} << 40, 60, true),
        end_of_zip(3, std::uint64_t{1} << 40, true)}) {
    support::write_file(zip, end);
    const auto done = unzip(zip, "data.zip", out, limits);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, ErrorCode::too_large) << done.error().message;
    EXPECT_NE(done.error().message.find("--max-dataset-files"), std::string::npos);
  }
}

TEST_F(ZipFolder, StopsAtTheLimitOfBytes) {
  limits.max_bytes = 1 << 20;
  const auto done = unpack({{"zeros", std::string(std::size_t{3} << 20, '\0')}});
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::too_large);
  EXPECT_LE(fs::file_size(out / "zeros"), limits.max_bytes) << "the limit holds while unpacking, not after";
}

TEST_F(ZipFolder, StopsAtTheLimitOfTheRatio) {
  limits.free_bytes = 1 << 16;
  limits.max_ratio = 10;
  const auto done = unpack({{"zeros", std::string(std::size_t{8} << 20, '\0')}});
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::too_large);
  EXPECT_LT(fs::file_size(out / "zeros"), std::uint64_t{1} << 20);
  limits.free_bytes = 16 << 20;
  fs::remove(out / "zeros");
  EXPECT_TRUE(unpack({{"zeros", std::string(std::size_t{8} << 20, '\0')}})) << "few bytes are no bomb";
}

TEST_F(ZipFolder, BelievesNoSizeInAHeader) {
  write_zip(zip, {{"zeros", std::string(std::size_t{4} << 20, '\0')}});
  std::string bytes = support::read_file(zip);
  const std::size_t directory = bytes.find("PK\x01\x02");
  ASSERT_NE(directory, std::string::npos);
  for (std::size_t i = 0; i < 4; ++i) bytes[directory + 24 + i] = i == 0 ? 1 : 0;  // "unpacks to 1 byte"
  support::write_file(zip, bytes);
  limits.max_bytes = 1 << 20;
  const auto done = unzip(zip, "data.zip", out, limits);
  EXPECT_FALSE(done);
  EXPECT_LE(fs::exists(out / "zeros") ? fs::file_size(out / "zeros") : 0, limits.max_bytes);
}

TEST_F(ZipFolder, NeverCrashesOnACutOrDamagedFile) {
  write_zip(zip,
            {{"a.txt", "some text that is long enough to be compressed, compressed, compressed"}, {"b/c", "more"}});
  const std::string whole = support::read_file(zip);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    SCOPED_TRACE(size);
    support::write_file(zip, whole.substr(0, size));
    fs::remove_all(out);
    fs::create_directories(out);
    EXPECT_FALSE(unzip(zip, "data.zip", out, limits));
  }
  for (std::size_t at = 0; at < whole.size(); ++at) {
    SCOPED_TRACE(at);
    std::string damaged = whole;
    damaged[at] = char(~damaged[at]);
    support::write_file(zip, damaged);
    fs::remove_all(out);
    fs::create_directories(out);
    (void)unzip(zip, "data.zip", out, limits);  // some bytes do not matter
    for (const auto& entry : fs::directory_iterator(temp.path()))
      EXPECT_TRUE(entry.path() == zip || entry.path() == out) << entry.path();
  }
}

TEST_F(ZipFolder, RefusesWhatIsNoZipFile) {
  support::write_file(zip, "hello");
  const auto done = unzip(zip, "data.zip", out, limits);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(done.error().where, "data.zip");
}

TEST_F(ZipFolder, SaysInOurOwnWordsWhyAnEntryCannotBeUnpacked) {
  write_zip(zip, {{"a.txt", std::string(2000, 'a')}});
  const std::string whole = support::read_file(zip);
  const std::size_t directory = whole.find("PK\x01\x02");
  ASSERT_NE(directory, std::string::npos);
  const auto reason = [&](std::size_t at, char value) {
    std::string damaged = whole;
    damaged[at] = value;
    support::write_file(zip, damaged);
    fs::remove_all(out);
    fs::create_directories(out);
    const auto done = unzip(zip, "data.zip", out, limits);
    return done ? "" : done.error().where + ": " + done.error().message;
  };
  EXPECT_EQ(reason(directory + 16, '!'),  // the checksum
            "data.zip:a.txt: the entry cannot be unpacked, it is damaged: make the zip file anew");
  EXPECT_EQ(reason(directory + 8, 1),  // the flag of encryption
            "data.zip:a.txt: the entry is encrypted: make the zip file without a password");
}

}  // namespace
}  // namespace server::scenes
