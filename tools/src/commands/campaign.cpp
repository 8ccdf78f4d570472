#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>

#include "campaign/campaign.hpp"
#include "commands.hpp"
#include "common/json_summary.hpp"
#include "common/progress.hpp"
#include "common/validators.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/parallel.hpp"

// trochoid campaign: many recordings, one process each; what is done is not done again.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct CampaignOptions {
  std::string manifest, part;
  int jobs = 0;
  bool summary_only = false, again = false, json = false;
};

/// "3/10": the third tenth of the items, for one job of an array on a cluster.
struct CampaignPart {
  std::size_t number = 1, of = 1;
  [[nodiscard]] bool has(std::size_t index) const { return index % of == number - 1; }
};

std::optional<CampaignPart> part_named(const std::string& text) {
  CampaignPart part;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%zu/%zu%c", &part.number, &part.of, &rest) != 2 ||
      part.number < 1 || part.number > part.of || text.find('-') != std::string::npos)
    return std::nullopt;
  return part;
}

CLI::Validator part_name() {
  return {[](const std::string& text) {
            return part_named(text) ? std::string()
                                    : "'" + text + "' is not K/N with K in 1..N, as in 3/10";
          },
          "K/N"};
}

std::vector<const CampaignItem*> share_of(const Campaign& campaign,
                                          const CampaignOptions& options) {
  const CampaignPart part = part_named(options.part).value_or(CampaignPart{});
  std::vector<const CampaignItem*> share;
  for (std::size_t i = 0; i < campaign.items.size(); ++i)
    if (part.has(i)) share.push_back(&campaign.items[i]);
  return share;
}

std::vector<const CampaignItem*> items_to_run(const Campaign& campaign,
                                              const CampaignOptions& options) {
  std::vector<const CampaignItem*> open = share_of(campaign, options);
  if (!options.again)
    std::erase_if(open, [&](const CampaignItem* item) {
      const auto record = current_record(campaign, *item);
      return record && record->done;
    });
  return open;
}

void run_items(const Campaign& campaign, const std::vector<const CampaignItem*>& items, int jobs) {
  Progress progress("campaign", "recordings");
  std::atomic<std::int64_t> done{0};
  data::in_parallel(items.size(), jobs, [&](std::size_t i) {
    const CampaignRecord record = run_item(campaign, *items[i]);
    detail(fmt::format("{}: exit status {} after {:.2f} s {}", record.name, record.exit_status,
                       record.seconds, record.message));
    progress.update(++done, static_cast<std::int64_t>(items.size()));
  });
}

/// What became of some of a campaign's recordings.
struct Tally {
  int recordings = 0, good = 0, not_good = 0, not_run = 0;
  std::vector<std::string> failures;  ///< names with their reasons

  /// Null for a recording that was not run.
  void add(const CampaignRecord* record) {
    ++recordings;
    if (record == nullptr)
      ++not_run;
    else if (!record->done)
      failures.push_back(fmt::format("{}: {}", record->name, record->message));
    else
      ++(record->exit_status == 0 ? good : not_good);
  }
};

/// @throws NotGood if any failed. `page`: where the summary is, empty if none was made.
void tell(const Tally& tally, const std::string& page, bool json) {
  if (json) {
    nlohmann::ordered_json answer{{"recordings", tally.recordings},
                                  {"good", tally.good},
                                  {"not_good", tally.not_good},
                                  {"failed", tally.failures.size()},
                                  {"not_run", tally.not_run}};
    if (!page.empty()) answer["summary"] = page;
    print_json(answer);
  } else {
    for (const std::string& failure : tally.failures) fmt::print("failed: {}\n", failure);
    fmt::print("{} recordings: {} good, {} not good, {} failed, {} not run{}\n", tally.recordings,
               tally.good, tally.not_good, tally.failures.size(), tally.not_run,
               page.empty() ? "" : fmt::format("; see {} and summary.csv", page));
  }
  if (!tally.failures.empty())
    throw NotGood(
        fmt::format("{} of {} recordings failed", tally.failures.size(), tally.recordings));
}

void summarise(const Campaign& campaign, bool json) {
  const std::vector<CampaignLine> lines = collect(campaign);
  data::write_text(summary_csv(lines), campaign.folder / "summary.csv");
  data::write_text(summary_html(campaign, lines), campaign.folder / "summary.html");
  Tally tally;
  for (const CampaignLine& line : lines) tally.add(line.known ? &line.record : nullptr);
  tell(tally, (campaign.folder / "summary.html").string(), json);
}

/// One job of an array does not know what the others have left: it answers for its own share only.
void tell_share(const Campaign& campaign, const CampaignOptions& options) {
  Tally tally;
  for (const CampaignItem* item : share_of(campaign, options)) {
    const auto record = current_record(campaign, *item);
    tally.add(record ? &*record : nullptr);
  }
  tell(tally, "", options.json);
}

void run(const CampaignOptions& options) {
  const Campaign campaign = read_campaign(options.manifest);
  std::vector<const CampaignItem*> items;
  if (!options.summary_only) items = items_to_run(campaign, options);
  check_items(campaign, items, check_run);
  std::error_code code;
  fs::create_directories(campaign.folder / "records", code);
  if (code)
    throw InputError(
        fmt::format("{}: cannot be made: {}", campaign.folder.string(), code.message()));
  if (!options.summary_only) {
    note(fmt::format("{} of {} recordings to run", items.size(), campaign.items.size()));
    run_items(campaign, items, options.jobs);
  }
  if (options.part.empty())
    summarise(campaign, options.json);
  else
    tell_share(campaign, options);
}

}  // namespace

void add_campaign_command(CLI::App& app) {
  auto options = std::make_shared<CampaignOptions>();
  CLI::App* command =
      app.add_subcommand("campaign", "Run many recordings; resume where it was interrupted");
  command->add_option("manifest", options->manifest, "Recordings and scenes (docs/campaigns.md)")
      ->required();
  command->add_option("-j,--jobs", options->jobs, "Recordings at a time; 0: one per core [0]")
      ->check(whole_number());
  CLI::Option* part = command->add_option(
      "--part", options->part,
      "Only the K-th of N equal shares, K/N, and no summary: for a cluster's array");
  part->check(part_name());
  command->add_flag("--summary", options->summary_only, "Run nothing, write the summary")
      ->excludes(part);
  add_json_flag(*command, options->json);
  command->add_flag("--again", options->again, "Also run again what is done")
      ->excludes("--summary");
  command->footer(
      "Example:\n  trochoid campaign lab.toml\nwrites lab.campaign/: open summary.html");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
