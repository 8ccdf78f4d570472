#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fnmatch.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <set>

#include "campaign/campaign.hpp"
#include "common/progress.hpp"
#include "common/recording_name.hpp"
#include "common/track_options.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

/// Keys of a [[recording]] that become options of `trochoid run`.
struct OptionKey {
  const char *key, *option;
};
constexpr std::array<OptionKey, 7> kOptions{{{"model", "--model"},
                                             {"from", "--from"},
                                             {"to", "--to"},
                                             {"objects", "--objects"},
                                             {"rate_hz", "--rate"},
                                             {"effort", "--effort"},
                                             {"seed", "--seed"}}};

[[noreturn]] void fail(const fs::path& manifest, const toml::node& node, const std::string& what) {
  throw InputError(fmt::format("{}:{}: {}", manifest.string(), node.source().begin.line, what));
}

std::string text_of(const fs::path& manifest, const toml::node& node, std::string_view key) {
  if (const auto text = node.value<std::string>(); text && node.is_string()) return *text;
  if (const auto whole = node.value<std::int64_t>(); whole && node.is_integer())
    return fmt::format("{}", *whole);
  if (const auto number = node.value<double>(); number && node.is_floating_point())
    return fmt::format("{}", *number);
  fail(manifest, node, fmt::format("{} must be a text or a number", key));
}

void check_keys(const fs::path& manifest, const toml::table& table, const char* where,
                const std::set<std::string_view>& known) {
  for (const auto& [key, value] : table)
    if (!known.contains(key.str()))
      fail(manifest, value,
           fmt::format("{} has no key '{}'; there are {}", where, key.str(),
                       fmt::join(known, ", ")));
}

bool is_pattern(const std::string& name) {
  return name.find_first_of("*?[") != std::string::npos;
}

/// The files a pattern in the last part of a path names, sorted.
std::vector<fs::path> expanded(const fs::path& path) {
  std::error_code code;
  if (!is_pattern(path.filename().string()) || fs::exists(path, code)) return {path};
  std::vector<fs::path> found;
  for (fs::directory_iterator entry(path.parent_path(), code), end; !code && entry != end;
       entry.increment(code)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with('.') && fnmatch(path.filename().c_str(), name.c_str(), 0) == 0)
      found.push_back(entry->path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

/// The folder of a recording as the manifest would name it.
fs::path folder_of(const fs::path& video, const fs::path& base) {
  const fs::path folder = video.parent_path(), seen_from_base = folder.lexically_relative(base);
  return seen_from_base.empty() ? folder : seen_from_base;
}

/// {stem} and {folder} of the recording put into a scene's or camera's name.
fs::path filled_in(std::string text, const fs::path& video, const fs::path& base) {
  for (const auto& [word, value] :
       {std::pair<std::string, std::string>{"{stem}", recording_name(video)},
        {"{folder}", folder_of(video, base)}})
    for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos; at += value.size())
      text.replace(at, word.size(), value);
  return text.empty() ? fs::path() : base / text;
}

/// A scene's or camera's name holds no words in braces but those that are filled in.
void check_placeholders(const fs::path& manifest, const toml::node& node, const char* key,
                        const std::string& text) {
  for (std::size_t open = text.find('{'); open != std::string::npos;
       open = text.find('{', open + 1)) {
    const std::string word = text.substr(open, text.find('}', open) - open) + "}";
    if (word != "{stem}" && word != "{folder}")
      fail(manifest, node,
           fmt::format("{} = '{}': {} stands for nothing; {{stem}} and {{folder}} are the "
                       "recording's",
                       key, text, word));
  }
}

std::string unique_name(const fs::path& video, std::set<std::string>& taken) {
  std::string name = recording_name(video);
  if (taken.contains(name)) name = video.parent_path().filename().string() + "_" + name;
  const std::string base = name;
  for (int i = 2; taken.contains(name); ++i) name = fmt::format("{}_{}", base, i);
  taken.insert(name);
  return name;
}

/// What is listed already, by the same files and options; patterns may overlap.
const CampaignItem* alike(const Campaign& campaign, const CampaignItem& item) {
  const auto same = [&](const CampaignItem& other) {
    return other.video.lexically_normal() == item.video.lexically_normal() &&
           other.scene.lexically_normal() == item.scene.lexically_normal() &&
           other.camera.lexically_normal() == item.camera.lexically_normal() &&
           other.options == item.options;
  };
  const auto found = std::find_if(campaign.items.begin(), campaign.items.end(), same);
  return found == campaign.items.end() ? nullptr : &*found;
}

void add_recordings(const toml::table& table, const fs::path& base, Campaign& campaign,
                    std::set<std::string>& taken) {
  std::set<std::string_view> known{"video", "scene", "camera"};
  for (const OptionKey& option : kOptions) known.insert(option.key);
  check_keys(campaign.manifest, table, "[[recording]]", known);
  if (!table.contains("video"))
    fail(campaign.manifest, table, "[[recording]] needs video = \"FILE or pattern\"");
  const auto text = [&](const char* key) {
    const toml::node* node = table.get(key);
    return node == nullptr ? std::string() : text_of(campaign.manifest, *node, key);
  };
  for (const char* key : {"scene", "camera"})
    if (table.contains(key)) check_placeholders(campaign.manifest, *table.get(key), key, text(key));
  std::string named = text("video");
  while (named.size() > 1 && named.back() == '/') named.pop_back();  // a folder of pictures
  const std::vector<fs::path> videos = expanded(base / named);
  if (videos.empty())
    fail(campaign.manifest, *table.get("video"),
         fmt::format("video = '{}' matches no file", text("video")));
  for (const fs::path& video : videos) {
    CampaignItem item{
        .name = {},
        .video = video,
        .scene = filled_in(text("scene"), video, base),
        .camera = filled_in(text("camera"), video, base),
        .options = {},
        .declared = fmt::format("{}:{}", campaign.manifest.string(), table.source().begin.line)};
    for (const OptionKey& option : kOptions)
      if (table.contains(option.key)) {
        item.options.emplace_back(option.option);
        item.options.push_back(text(option.key));
        if (std::string_view(option.key) == "effort" && !is_effort(item.options.back()))
          fail(campaign.manifest, *table.get(option.key),
               fmt::format("effort = '{}': it is quick, normal or exact", item.options.back()));
      }
    if (const CampaignItem* same = alike(campaign, item)) {
      note(fmt::format("{}: {} is named before, in {}, to be run in the same way; it is run once",
                       item.declared, video.string(), same->declared));
      continue;
    }
    item.name = unique_name(video, taken);
    campaign.items.push_back(std::move(item));
  }
}

}  // namespace

Campaign read_campaign(const fs::path& manifest) {
  Campaign campaign{.manifest = manifest, .folder = {}, .items = {}};
  if (!fs::is_regular_file(manifest))
    throw InputError(
        fmt::format("{}: no such file; write a manifest (docs/campaigns.md)", manifest.string()));
  toml::table file;
  try {
    file = toml::parse(data::read_text(manifest), manifest.string());
  } catch (const toml::parse_error& error) {
    throw InputError(fmt::format("{}:{}: {}", manifest.string(), error.source().begin.line,
                                 error.description()));
  }
  check_keys(manifest, file, "a manifest", {"campaign", "recording"});
  const fs::path base = manifest.has_parent_path() ? manifest.parent_path() : fs::path(".");
  campaign.folder = base / (manifest.stem().string() + ".campaign");
  if (const toml::node* settings = file.get("campaign")) {
    if (!settings->is_table()) fail(manifest, *settings, "campaign must be a table [campaign]");
    check_keys(manifest, *settings->as_table(), "[campaign]", {"folder"});
    if (const toml::node* folder = settings->as_table()->get("folder"))
      campaign.folder = base / text_of(manifest, *folder, "folder");
  }
  std::set<std::string> taken;
  const toml::node* recordings = file.get("recording");
  if (recordings == nullptr || !recordings->is_array_of_tables())
    throw InputError(
        fmt::format("{}: names no recording; add [[recording]] tables", manifest.string()));
  for (const toml::node& recording : *recordings->as_array())
    add_recordings(*recording.as_table(), base, campaign, taken);
  return campaign;
}

}  // namespace trochoid::tools
