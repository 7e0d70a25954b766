#include "help/manual.h"

#include <algorithm>
#include <cctype>
#include <sstream>

#include "marble/version.h"

namespace marble::cli {
namespace {

constexpr std::size_t kLongestTag = 40;

// Returns text in which roff finds no requests and no escapes.
std::string plain(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '\\') {
      result += "\\e";
    } else if (c == '-') {
      result += "\\-";
    } else if (c == '\n') {
      result += ' ';
    } else {
      result += c;
    }
  }
  return result.starts_with('.') || result.starts_with('\'') ? "\\&" + result : result;
}

std::string bold(const std::string& text) { return "\\fB" + plain(text) + "\\fR"; }
std::string italic(const std::string& text) { return "\\fI" + plain(text) + "\\fR"; }

std::string header(const std::string& name, const std::string& description) {
  std::string title = name;
  std::ranges::transform(title, title.begin(), [](unsigned char c) { return std::toupper(c); });
  return ".TH " + plain(title) + " 1 \"\" \"Marble Server " + kVersion + "\" \"User commands\"\n.SH NAME\n" +
         plain(name) + " \\- " + plain(description) + "\n";
}

std::string paragraph(const std::string& tag, const std::string& description) {
  return ".TP\n" + tag + "\n" + (description.empty() ? "\\&" : plain(description)) + "\n";
}

std::string options_section(const std::vector<Argument>& options) {
  std::string text = options.empty() ? "" : ".SH OPTIONS\n";
  for (const Argument& option : options) {
    std::string tag;
    for (const std::string& name : option.names) tag += (tag.empty() ? "" : ", ") + bold(name);
    std::string choices;
    for (const std::string& choice : option.choices) choices += (choices.empty() ? "" : "|") + choice;
    const bool few =
        !choices.empty() && choices.size() <= kLongestTag;  // else the tag would be longer than a line
    if (option.takes_value) tag += " " + (few ? bold(choices) : italic(option.place));
    std::string description = option.description;
    if (!few) {
      for (const std::string& choice : option.choices)
        description += (&choice == &option.choices.front() ? "; one of " : ", ") + choice;
    }
    text += paragraph(tag, description);
  }
  return text;
}

// The footer of a help: a paragraph for each sentence that begins a line.
std::string notes(const std::string& footer) {
  if (footer.empty()) return "";
  std::string text = ".SH NOTES\n";
  std::istringstream lines(footer);
  bool first = true, ended = true;
  for (std::string line; std::getline(lines, line);) {
    if (!first && ended) text += ".PP\n";
    text += plain(line) + "\n";
    ended = line.ends_with('.') || line.empty();
    first = false;
  }
  return text;
}

}  // namespace

std::string program_page(const std::vector<Command>& commands) {
  const Command& program = commands.front();
  std::string text = header(program.name, "solve quadratic programs with complementarity constraints");
  text += ".SH SYNOPSIS\n" + bold(program.name) + " " + italic("COMMAND") + " [" + italic("OPTION") +
          "...]\n.SH DESCRIPTION\n" + plain(program.description) + "\n.SH COMMANDS\n";
  for (std::size_t i = 1; i < commands.size(); ++i) {
    text += paragraph(bold(program.name + "-" + commands[i].name) + "(1)", commands[i].description);
  }
  text += options_section(program.options) + notes(program.footer) + ".SH ENVIRONMENT\n" +
          paragraph(bold("MARBLE_SERVER"), "address of the server; local solves in this process") +
          ".SH SEE ALSO\n" + bold("marble-load") + "(1), " + bold("marble-server") + "(8)\n";
  return text;
}

std::string command_page(const Command& command) {
  std::string text = header("marble-" + command.name, command.description);
  text += ".SH SYNOPSIS\n" + bold("marble " + command.name) + " [" + italic("OPTION") + "...]";
  for (const Argument& place : command.places) {
    const std::string name = italic(place.place) + (place.repeats ? "..." : "");
    text += " " + (place.required ? name : "[" + name + "]");
  }
  text += "\n.SH DESCRIPTION\n" + plain(command.description) + ".\n";
  for (const Argument& place : command.places) text += paragraph(italic(place.place), place.description);
  return text + options_section(command.options) + notes(command.footer) + ".SH SEE ALSO\n" + bold("marble") +
         "(1)\n";
}

}  // namespace marble::cli
