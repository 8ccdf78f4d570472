#include "files_for_tests.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {
namespace {

TEST(WriteText, LeavesTheWholeTextAndNoTemporaryFile) {
  const TestFolder folder;
  write_text("hello\n", folder / "a.txt");
  write_text("world\n", folder / "a.txt");
  EXPECT_EQ(content(folder / "a.txt"), "world\n");
  EXPECT_EQ(folder.entries(), 1);
}

TEST(WriteText, TakesANameAsLongAsNamesMayBe) {
  const TestFolder folder;
  const std::string longest = std::string(251, 'a') + ".txt";
  write_text("hello\n", folder / longest);
  EXPECT_EQ(content(folder / longest), "hello\n");
  EXPECT_EQ(folder.entries(), 1);
  const std::string message = refusal([&] { write_text("x", folder / ("a" + longest)); });
  EXPECT_NE(message.find("too long"), std::string::npos) << message;
  EXPECT_EQ(folder.entries(), 1);
}

TEST(WriteText, RefusesAFolderThatDoesNotExistAndNamesIt) {
  const TestFolder folder;
  const std::string message = refusal([&] { write_text("x", folder / "missing" / "a.txt"); });
  EXPECT_NE(message.find("missing"), std::string::npos) << message;
  EXPECT_EQ(folder.entries(), 0);
}

TEST(WriteText, RefusesAFolderAsTarget) {
  const TestFolder folder;
  EXPECT_NE(refusal([&] { write_text("x", folder.path()); }).find("folder"), std::string::npos);
}

TEST(WriteText, LeavesAWriteProtectedFileAlone) {
  if (::geteuid() == 0) GTEST_SKIP() << "nothing is protected from root";
  const TestFolder folder;
  const auto path = folder.write("kept.txt", "old");
  std::filesystem::permissions(path, std::filesystem::perms::owner_read);
  EXPECT_NE(refusal([&] { write_text("new", path); }).find("write-protected"), std::string::npos);
  EXPECT_EQ(content(path), "old");
}

// A file on a share that goes away, or a bad block: the first page of the own memory cannot be read
// either.
TEST(ReadText, DoesNotTakeWhatCannotBeReadForTheEnd) {
  const char* const unreadable = "/proc/self/mem";
  if (!std::ifstream(unreadable)) GTEST_SKIP() << "no file opens that cannot be read";
  EXPECT_NE(refusal([&] { (void)read_text(unreadable); }).find("reading failed"),
            std::string::npos);
  EXPECT_NE(refusal([&] { (void)sha256_of_file(unreadable); }).find("reading failed"),
            std::string::npos);
}

TEST(WriteText, WritesIntoADeviceInsteadOfReplacingIt) {
  write_text("gone", "/dev/null");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST(WriteText, WritesThroughALinkAndKeepsIt) {
  const TestFolder folder;
  folder.write("real.txt", "old");
  std::filesystem::create_symlink("real.txt", folder / "link.txt");
  write_text("new", folder / "link.txt");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.txt"));
  EXPECT_EQ(content(folder / "real.txt"), "new");
}

TEST(PendingFile, VanishesUnlessCommitted) {
  const TestFolder folder;
  {
    const PendingFile pending(folder / "film.mp4");
    EXPECT_EQ(pending.path().extension(), ".mp4");
    std::ofstream(pending.path()) << "half a film";
  }
  EXPECT_EQ(folder.entries(), 0);
}

TEST(PendingFile, BecomesItsTargetOnCommit) {
  const TestFolder folder;
  {
    PendingFile pending(folder / "film.mp4");
    std::ofstream(pending.path()) << "film";
    pending.commit();
  }
  EXPECT_EQ(content(folder / "film.mp4"), "film");
  EXPECT_EQ(folder.entries(), 1);
}

// The two values of FIPS 180-4's examples.
TEST(Sha256, AgreesWithThePublishedExamples) {
  const TestFolder folder;
  EXPECT_EQ(sha256_of_file(folder.write("abc", "abc")),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_of_file(folder.write("empty", "")),
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Sha256, OfAMissingFileOrAFolderIsRefused) {
  const TestFolder folder;
  EXPECT_NE(refusal([&] { static_cast<void>(sha256_of_file(folder / "none")); }).find("none"),
            std::string::npos);
  static_cast<void>(refusal([&] { static_cast<void>(sha256_of_file(folder.path())); }));
}

}  // namespace
}  // namespace trochoid::data
