#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "common/outputs.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

// manual: man pages and bash completion from the same declarations that --help prints.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct ManualOptions {
  fs::path folder;
};

std::vector<const CLI::App*> shown_commands(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* c) { return !c->get_group().empty(); });
}
std::vector<const CLI::Option*> shown_options(const CLI::App& app) {
  return app.get_options([](const CLI::Option* o) { return !o->get_group().empty(); });
}

/// Text for roff: backslashes and hyphens are its own, and a line must not start with a dot.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n')) out += "\\&";
    if (c == '\\')
      out += "\\\\";
    else if (c == '-')
      out += "\\-";
    else
      out += c;
  }
  return out;
}

std::string option_entry(const CLI::Option& option) {
  const bool positional = option.get_positional();
  std::string name = option.get_name(positional, !positional);
  if (!option.get_type_name().empty() && option.get_items_expected_max() > 0)
    name += " " + option.get_type_name();
  std::string text = fmt::format(".TP\n.B {}\n{}", roff(name), roff(option.get_description()));
  if (!option.get_default_str().empty())
    text += fmt::format(" [{}]", roff(option.get_default_str()));
  if (option.get_required()) text += " (required)";
  return text + "\n";
}

/// One page for a command and, below it, its own subcommands.
void add_section(const CLI::App& app, const std::string& words, std::string& page) {
  page += fmt::format(".SH {}\n{}\n", roff(words), roff(app.get_description()));
  for (const CLI::Option* option : shown_options(app)) page += option_entry(*option);
  if (!app.get_footer().empty()) page += fmt::format(".PP\n.nf\n{}\n.fi\n", roff(app.get_footer()));
  for (const CLI::App* command : shown_commands(app))
    add_section(*command, words + " " + command->get_name(), page);
}

std::string title(const std::string& name) {
  return fmt::format(".TH {} 1 \"\" \"trochoid {}\" \"User Commands\"\n", roff(name),
                     TROCHOID_VERSION);
}

std::string page_of(const CLI::App& app, const CLI::App& command) {
  const std::string name = "trochoid-" + command.get_name();
  std::string page = title(name);
  page += fmt::format(".SH NAME\n{} \\- {}\n", roff(name), roff(command.get_description()));
  add_section(command, "trochoid " + command.get_name(), page);
  page += ".SH ALSO, WITH EVERY COMMAND\n";
  for (const CLI::Option* option : shown_options(app)) page += option_entry(*option);
  return page + ".SH SEE ALSO\n.BR trochoid (1)\n";
}

std::string main_page(const CLI::App& app) {
  std::string page = title("trochoid");
  page += fmt::format(".SH NAME\ntrochoid \\- {}\n", roff("spinning and rolling discs in video"));
  page += fmt::format(".SH DESCRIPTION\n{}\n", roff(app.get_description()));
  page += ".SH COMMANDS\n";
  for (const CLI::App* command : shown_commands(app))
    page += fmt::format(".TP\n.BR trochoid\\-{} (1)\n{}\n", roff(command->get_name()),
                        roff(command->get_description()));
  page += ".SH OPTIONS\n";
  for (const CLI::Option* option : shown_options(app)) page += option_entry(*option);
  page +=
      ".SH EXIT STATUS\n0 done; 1 an input was wrong; 2 a wrong option; 3 finished, but the answer "
      "is not good.\n";
  return page;
}

std::string words_of(const CLI::App& app) {
  std::string words;
  for (const CLI::Option* option : shown_options(app))
    for (const std::string& name : option->get_lnames()) words += " --" + name;
  for (const CLI::App* command : shown_commands(app)) words += " " + command->get_name();
  return words;
}

std::string completion(const CLI::App& app) {
  // Whole words, between blanks: one command's name may begin with another's.
  std::string cases;
  const std::string everywhere = words_of(app);
  for (const CLI::App* command : shown_commands(app)) {
    for (const CLI::App* below : shown_commands(*command))
      cases += fmt::format("    \" {}\"*\" {} \"*) words=\"{}\" ;;\n", command->get_name(),
                           below->get_name(), words_of(*below));
    cases +=
        fmt::format("    \" {} \"*) words=\"{}\" ;;\n", command->get_name(), words_of(*command));
  }
  return fmt::format(
      "# bash completion of trochoid {}\n"
      "_trochoid() {{\n"
      "  local current=${{COMP_WORDS[COMP_CWORD]}} words\n"
      "  case \" ${{COMP_WORDS[*]:1:COMP_CWORD-1}} \" in\n{}"
      "    *) words=\"{}\" ;;\n"
      "  esac\n"
      "  COMPREPLY=($(compgen -W \"$words\" -- \"$current\") $(compgen -f -- \"$current\"))\n"
      "}}\n"
      "complete -o filenames -F _trochoid trochoid\n",
      TROCHOID_VERSION, cases, everywhere);
}

void run(const CLI::App& app, const ManualOptions& options) {
  const fs::path man = options.folder / "man1";
  make_folder(man);
  data::write_text(main_page(app), man / "trochoid.1");
  for (const CLI::App* command : shown_commands(app))
    data::write_text(page_of(app, *command),
                     man / fmt::format("trochoid-{}.1", command->get_name()));
  data::write_text(completion(app), options.folder / "trochoid.bash");
}

}  // namespace

void add_manual_command(CLI::App& app) {
  auto options = std::make_shared<ManualOptions>();
  CLI::App* command =
      app.add_subcommand("manual", "Write man pages and bash completion into a folder");
  command->add_option("folder", options->folder, "Folder to make")->required();
  command->footer("Example: trochoid manual pages/ && man pages/man1/trochoid.1");
  command->callback([options, &app] { run(app, *options); });
}

}  // namespace trochoid::tools
