#include "decode/image_sequence.hpp"

#include <fmt/core.h>
#include <glob.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <map>
#include <numeric>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "trochoid/data/error.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {
namespace {

namespace fs = std::filesystem;
using Pictures = std::vector<fs::path>;

bool is_digit(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0;
}

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

/// A picture's name with every number in it replaced: what those of one series share.
std::string pattern_of(const fs::path& picture) {
  std::string pattern;
  for (const char c : picture.stem().string())
    if (!is_digit(c))
      pattern += c;
    else if (!pattern.ends_with('#'))
      pattern += '#';
  return pattern;
}

/// Those of the type the folder holds most of.
Pictures commonest_in(const fs::path& folder) {
  std::map<std::string, Pictures> by_type;
  for (const fs::path& picture : pictures_in(folder))
    by_type[lower_extension(picture)].push_back(picture);
  return std::max_element(
             by_type.begin(), by_type.end(),
             [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); })
      ->second;
}

/// Those with a printf-style name.
Pictures pictures_of_series(const fs::path& path) {
  const std::string name = path.filename().string();
  const std::size_t percent = name.find('%'), d = name.find('d', percent);
  if (d == std::string::npos)
    throw InputError(fmt::format("{}: a numbered series needs one %d or %04d", path.string()));
  const std::string head = name.substr(0, percent), tail = name.substr(d + 1);
  const auto width =
      static_cast<std::size_t>(std::atoi(name.substr(percent + 1, d - percent - 1).c_str()));
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (!fs::is_directory(folder))
    throw InputError(fmt::format("{}: no such folder", folder.string()));
  const auto belongs = [&](const std::string& file) {
    if (file.size() <= head.size() + tail.size() || !file.starts_with(head) ||
        !file.ends_with(tail))
      return false;
    const std::string digits = file.substr(head.size(), file.size() - head.size() - tail.size());
    return std::all_of(digits.begin(), digits.end(), is_digit) &&
           (digits.size() == std::max<std::size_t>(width, 1) ||
            (digits.size() > width && digits.front() != '0'));
  };
  Pictures pictures;
  for (const auto& entry : fs::directory_iterator(folder))
    if (belongs(entry.path().filename().string())) pictures.push_back(entry.path());
  if (pictures.empty()) throw InputError(fmt::format("{}: no image of that series", path.string()));
  return pictures;
}

Pictures pictures_like(const fs::path& pattern) {
  Pictures pictures;
  glob_t found{};
  if (::glob(pattern.c_str(), 0, nullptr, &found) == 0)
    pictures.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  ::globfree(&found);
  if (pictures.empty()) throw InputError(fmt::format("{}: no such file", pattern.string()));
  std::erase_if(pictures, [](const fs::path& file) { return !is_image(file); });
  if (pictures.empty())
    throw InputError(fmt::format("{}: no images have such names; of videos name one at a time",
                                 pattern.string()));
  return pictures;
}

/// The numbers by which alone the names differ; nothing if they differ by more, or in their folder.
/// @param begin  where in a name the number begins, if that is known.
std::optional<std::vector<std::int64_t>> numbers_of(const Pictures& pictures,
                                                    std::optional<std::size_t> begin) {
  constexpr std::size_t kMostDigits = 18;
  std::vector<std::string> names;
  for (const fs::path& picture : pictures) {
    if (picture.parent_path() != pictures.front().parent_path()) return std::nullopt;
    names.push_back(picture.stem().string() + lower_extension(picture));
  }
  const auto [least, most] = std::minmax_element(names.begin(), names.end());
  std::size_t head = static_cast<std::size_t>(
      std::mismatch(least->begin(), least->end(), most->begin(), most->end()).first -
      least->begin());
  while (head > 0 && is_digit((*least)[head - 1])) --head;
  head = begin.value_or(head);
  const std::size_t dot = names.front().find_first_not_of("0123456789", head);
  const std::string tail = dot == std::string::npos ? "" : names.front().substr(dot);
  std::vector<std::int64_t> numbers;
  for (const std::string& name : names) {
    const std::size_t end = std::min(name.size(), name.find_first_not_of("0123456789", head));
    if (end == head || end - head > kMostDigits || name.substr(end) != tail) return std::nullopt;
    numbers.push_back(std::stoll(name.substr(head, end - head)));
  }
  return numbers;
}

/// Whether a number in a picture's name is one that the series lacks.
bool may_fill_a_gap(const fs::path& stray, const Pictures& series) {
  const std::string name = stray.stem().string();
  if (std::none_of(name.begin(), name.end(), is_digit)) return false;
  const auto numbers = numbers_of(series, std::nullopt);
  if (!numbers) return true;
  const std::set<std::int64_t> there(numbers->begin(), numbers->end());
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (!is_digit(name[i])) continue;
    std::int64_t number = 0;
    const auto [end, error] = std::from_chars(name.data() + i, name.data() + name.size(), number);
    i = static_cast<std::size_t>(end - name.data());
    if (error == std::errc() && number >= *there.begin() && number <= *there.rbegin() &&
        !there.contains(number))
      return true;
  }
  return false;
}

/// Takes the pictures that are no part of the numbered series which most of them are: a cover, a
/// copy. They would be frames, and hide the gaps of the series. Not where one may be what a gap of
/// the series lacks (a burst's "..._0017_COVER"), or its numbers cannot be told.
Pictures take_strays(Pictures& pictures) {
  std::map<std::string, std::size_t> count;
  for (const fs::path& picture : pictures) ++count[pattern_of(picture)];
  const auto most = std::max_element(
      count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  const std::string& usual = most->first;
  if (usual.find('#') == std::string::npos || 2 * most->second <= pictures.size()) return {};
  const auto strays =
      std::stable_partition(pictures.begin(), pictures.end(),
                            [&](const fs::path& picture) { return pattern_of(picture) == usual; });
  Pictures taken(strays, pictures.end());
  if (std::any_of(taken.begin(), taken.end(), [&](const fs::path& stray) {
        return may_fill_a_gap(stray, Pictures(pictures.begin(), strays));
      }))
    return {};
  pictures.erase(strays, pictures.end());
  std::sort(taken.begin(), taken.end());
  return taken;
}

ImageSequence in_order(Pictures pictures, std::optional<std::size_t> begin = std::nullopt) {
  // Numbers in names by value, for where names differ by more than one: f9, f10, cover.
  std::sort(pictures.begin(), pictures.end(), [](const fs::path& a, const fs::path& b) {
    return ::strverscmp(a.c_str(), b.c_str()) < 0;
  });
  std::vector<std::int64_t> frames(pictures.size());
  std::iota(frames.begin(), frames.end(), 0);
  const auto numbers = numbers_of(pictures, begin);
  if (!numbers) return {std::move(pictures), std::move(frames), {}};

  std::vector<std::pair<std::int64_t, fs::path>> numbered;
  for (std::size_t i = 0; i < pictures.size(); ++i)
    numbered.emplace_back((*numbers)[i], std::move(pictures[i]));
  std::sort(numbered.begin(), numbered.end());
  const auto twice =
      std::adjacent_find(numbered.begin(), numbered.end(),
                         [](const auto& a, const auto& b) { return a.first == b.first; });
  if (twice != numbered.end())
    throw InputError(fmt::format("{} has the same number as {}: which comes first? remove one",
                                 twice->second.string(), std::next(twice)->second.string()));
  std::int64_t step = 0;
  for (const auto& [number, picture] : numbered)
    step = std::gcd(step, number - numbered.front().first);
  ImageSequence sequence;
  for (auto& [number, picture] : numbered) {
    sequence.pictures.push_back(std::move(picture));
    sequence.frames.push_back((number - numbered.front().first) / std::max<std::int64_t>(step, 1));
  }
  if (2 * sequence.missing() > sequence.frames.back() + 1) sequence.frames = std::move(frames);
  return sequence;
}

}  // namespace

Pictures pictures_in(const fs::path& folder) {
  Pictures pictures;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && is_image(entry.path()) &&
        !entry.path().filename().string().starts_with('.'))  // a Mac's ._f1.png is none
      pictures.push_back(entry.path());
  if (pictures.empty())
    throw InputError(
        fmt::format("{}: the folder holds no images; name a video file, or a folder of images",
                    folder.string()));
  std::sort(pictures.begin(), pictures.end());
  return pictures;
}

std::optional<ImageSequence> find_image_sequence(const fs::path& path) {
  if (fs::is_directory(path)) {
    Pictures pictures = commonest_in(path), strays = take_strays(pictures);
    ImageSequence sequence = in_order(std::move(pictures));
    sequence.left_out = std::move(strays);
    return sequence;
  }
  if (fs::exists(path)) return std::nullopt;
  const std::string name = path.filename().string();
  if (const std::size_t number = name.find('%'); number != std::string::npos)
    return in_order(pictures_of_series(path), number);
  if (path.string().find_first_of("*?[") != std::string::npos) return in_order(pictures_like(path));
  return std::nullopt;
}

}  // namespace trochoid::tracking
