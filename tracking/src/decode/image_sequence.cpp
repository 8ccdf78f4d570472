#include "decode/image_sequence.hpp"

#include <fmt/core.h>
#include <glob.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <climits>
#include <cstdlib>
#include <map>
#include <string_view>

#include "trochoid/data/error.hpp"

namespace trochoid::tracking {
namespace {

namespace fs = std::filesystem;

std::string lower_extension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

bool is_image(const fs::path& path) {
  static constexpr std::array<std::string_view, 9> kKnown{".png",  ".jpg", ".jpeg", ".bmp", ".tif",
                                                          ".tiff", ".pgm", ".ppm",  ".webp"};
  return std::find(kKnown.begin(), kKnown.end(), lower_extension(path)) != kKnown.end();
}

ImageSequence images_of_folder(const fs::path& folder) {
  std::map<std::string, int> count;  // by extension as written: patterns are case-sensitive
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && is_image(entry.path()))
      ++count[entry.path().extension().string()];
  if (count.empty())
    throw InputError(
        fmt::format("{}: the folder holds no images; name a video file, or a folder of images",
                    folder.string()));
  const auto most = std::max_element(
      count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return {ImageSequence::Kind::pattern, (folder / ("*" + most->first)).string(), 0};
}

/// Lowest number for which the printf-style name exists; libav itself only tries 0 to 4.
ImageSequence numbered_series(const fs::path& path) {
  const std::string name = path.filename().string();
  const std::size_t percent = name.find('%'), d = name.find('d', percent);
  if (d == std::string::npos)
    throw InputError(fmt::format("{}: a numbered series needs one %d or %04d", path.string()));
  const std::string head = name.substr(0, percent), tail = name.substr(d + 1);
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (!fs::is_directory(folder))
    throw InputError(fmt::format("{}: no such folder", folder.string()));
  int first = INT_MAX;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename().string();
    if (file.size() <= head.size() + tail.size() || !file.starts_with(head) ||
        !file.ends_with(tail))
      continue;
    const std::string digits = file.substr(head.size(), file.size() - head.size() - tail.size());
    if (digits.size() < 10 &&
        std::all_of(digits.begin(), digits.end(), [](unsigned char c) { return std::isdigit(c); }))
      first = std::min(first, std::stoi(digits));
  }
  if (first == INT_MAX) throw InputError(fmt::format("{}: no image of that series", path.string()));
  return {ImageSequence::Kind::numbered, path.string(), first};
}

}  // namespace

ImageSequence find_image_sequence(const fs::path& path) {
  const std::string text = path.string();
  if (fs::is_directory(path)) return images_of_folder(path);
  if (fs::exists(path)) return {ImageSequence::Kind::file, text, 0};
  if (text.find('%') != std::string::npos) return numbered_series(path);
  if (text.find_first_of("*?[") != std::string::npos)
    return {ImageSequence::Kind::pattern, text, 0};
  return {ImageSequence::Kind::file, text, 0};
}

std::vector<fs::path> pictures_of(const ImageSequence& sequence) {
  std::vector<fs::path> pictures;
  if (sequence.kind == ImageSequence::Kind::pattern) {
    glob_t found{};
    if (::glob(sequence.url.c_str(), 0, nullptr, &found) == 0)
      pictures.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
    ::globfree(&found);
  } else if (sequence.kind == ImageSequence::Kind::numbered) {
    const std::size_t percent = sequence.url.rfind('%'), d = sequence.url.find('d', percent);
    const int digits = std::atoi(sequence.url.substr(percent + 1, d - percent - 1).c_str());
    for (int number = sequence.first_number;; ++number) {
      pictures.emplace_back(sequence.url.substr(0, percent) +
                            fmt::format("{:0{}d}", number, digits) + sequence.url.substr(d + 1));
      if (!fs::exists(pictures.back())) break;
    }
    pictures.pop_back();
  } else {
    pictures.emplace_back(sequence.url);
  }
  return pictures;
}

InputHandle open_input(const ImageSequence& sequence, std::optional<double> frame_rate_hz,
                       const std::string& name) {
  AVDictionary* options = nullptr;
  const AVInputFormat* format = nullptr;
  std::string url = sequence.url;
  if (sequence.is_sequence()) {
    format = av_find_input_format("image2");
    av_dict_set(&options, "framerate", fmt::format("{:.9g}", frame_rate_hz.value_or(25.0)).c_str(),
                0);
    const bool numbered = sequence.kind == ImageSequence::Kind::numbered;
    av_dict_set(&options, "pattern_type", numbered ? "sequence" : "glob", 0);
    if (numbered) av_dict_set_int(&options, "start_number", sequence.first_number, 0);
  } else {
    url = "file:" + url;                               // a colon in a file name is not a protocol,
    av_dict_set(&options, "pattern_type", "none", 0);  // nor is %d in a picture's a series
  }
  AVFormatContext* raw = nullptr;
  const int status = avformat_open_input(&raw, url.c_str(), format, &options);
  av_dict_free(&options);
  if (status < 0)
    throw InputError(fmt::format("{}: not a readable video ({})", name, libav_words(status)));
  return InputHandle(raw);
}

}  // namespace trochoid::tracking
