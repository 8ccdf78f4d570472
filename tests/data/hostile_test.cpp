#include <functional>
#include <random>

#include "files_for_tests.hpp"
#include "trochoid/data/io.hpp"

// Readers either read or refuse with an InputError of one line, whatever the bytes are. Run under
// the sanitizers this also shows that no byte leads out of bounds.
namespace trochoid::data {
namespace {

// One of: flip a byte, cut the end off, repeat a piece, drop a piece, insert a spiteful word.
std::string damaged(std::string text, std::mt19937& draw) {
  const auto below = [&](std::size_t n) {
    return n == 0 ? 0 : std::uniform_int_distribution<std::size_t>(0, n - 1)(draw);
  };
  static const std::vector<std::string> kSpite = {"nan",
                                                  "inf",
                                                  "-1",
                                                  "1e999",
                                                  "\"",
                                                  "[",
                                                  "]",
                                                  "{",
                                                  "}",
                                                  ",",
                                                  "\n",
                                                  "=",
                                                  "\r",
                                                  "\xff",
                                                  "''",
                                                  "0x",
                                                  "#",
                                                  ":",
                                                  std::string(1, '\0'),
                                                  "99999999999999999999",
                                                  "null"};
  for (std::size_t edits = 1 + below(4); edits > 0; --edits) {
    const std::size_t at = below(text.size() + 1), length = below(20);
    switch (below(5)) {
      case 0:
        if (at < text.size()) text[at] = static_cast<char>(below(256));
        break;
      case 1:
        text.resize(at);
        break;
      case 2:
        text.insert(at, text.substr(at, length));
        break;
      case 3:
        text.erase(at, length);
        break;
      default:
        text.insert(at, kSpite[below(kSpite.size())]);
    }
  }
  return text;
}

struct Reader {
  const char* name;
  const char* file;  ///< a good example, below the sources
  std::function<void(const std::filesystem::path&)> read;
};
class AnyReader : public testing::TestWithParam<Reader> {};

TEST_P(AnyReader, ReadsOrRefusesDamagedFilesAndNeverDoesAnythingElse) {
  constexpr unsigned kSeed = 20260101;
  constexpr int kFiles = 150;
  std::mt19937 draw(kSeed);
  const TestFolder folder;
  const auto whole = std::filesystem::path(TROCHOID_SOURCE_DIR) / GetParam().file;
  ASSERT_NO_THROW(GetParam().read(whole));
  // The first lines of a long file hold all its kinds of content.
  const std::string good = content(whole).substr(0, 3000);
  int refused = 0;
  for (int i = 0; i < kFiles; ++i) {
    const auto path = folder.write("damaged", damaged(good, draw));
    try {
      GetParam().read(path);
    } catch (const InputError& error) {
      ++refused;
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    } catch (const std::exception& error) {
      ADD_FAILURE() << "seed " << kSeed << " file " << i << ": " << error.what() << "\n"
                    << content(path);
    }
  }
  EXPECT_GT(refused, 0);
}

template <class Result>
auto reading(Result (*read)(const std::filesystem::path&)) {
  return [read](const std::filesystem::path& path) { static_cast<void>(read(path)); };
}

INSTANTIATE_TEST_SUITE_P(
    Files, AnyReader,
    testing::Values(
        Reader{"Scene", "tests/data/files/ring.toml", reading(read_scene)},
        Reader{"Track", "tests/data/files/top.track.csv", reading(read_track)},
        Reader{"Fit", "tests/data/files/top.fit.json", reading(read_fit)},
        Reader{"Camera", "data/samples/s5_top_marker/camera.json", reading(read_camera)},
        Reader{"Object", "data/samples/s5_top_marker/object.json", reading(read_object)},
        Reader{"Table", "data/reference/s06_roll_disc.csv", reading(read_table)}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace trochoid::data
