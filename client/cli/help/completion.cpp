#include "help/completion.h"

#include <string_view>

namespace marble::cli {
namespace {

constexpr const char* kSolverOption = "--option";  // whose value is NAME=VALUE

std::string joined(const std::vector<std::string>& words, const std::string& after = "") {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word + after;
  return text;
}

// Returns the beginning of a description, up to the first remark.
std::string brief(const std::string& description) {
  return description.substr(0, std::min(description.find("; "), description.find(" (")));
}

// Puts a backslash before each of these characters.
std::string escaped(std::string_view text, std::string_view special) {
  std::string result;
  for (const char c : text) {
    if (special.find(c) != std::string_view::npos) result += '\\';
    result += c;
  }
  return result;
}

// Returns a word of a shell in single quotes; `quote` stands for one within them.
std::string in_quotes(std::string_view text, const char* quote) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string(quote) : std::string(1, c);
  return result + "'";
}

bool is_solver_option(const Argument& argument) {
  return !argument.names.empty() && argument.names.back() == kSolverOption;
}

std::vector<std::string> names_of(const std::vector<Argument>& options) {
  std::vector<std::string> names;
  for (const Argument& option : options) names.insert(names.end(), option.names.begin(), option.names.end());
  return names;
}

std::string alternatives(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : " | ") + name;
  return text;
}

// The branch of a command in bash: what may follow $previous, and what may stand by itself.
std::string bash_branch(const Command& command) {
  std::string text =
      "    " + command.name + ")\n      options=\"" + joined(names_of(command.options)) + "\"\n";
  if (!command.places.empty() && !command.places.front().choices.empty())
    text += "      words=\"" + joined(command.places.front().choices) + "\"\n";
  std::string cases, files;
  for (const Argument& option : command.options) {
    if (!option.takes_value) continue;
    if (is_solver_option(option)) {
      cases += "        --option) values=\"$solver_options\" ;;\n";
    } else if (!option.choices.empty()) {
      cases += "        " + alternatives(option.names) + ") values=\"" + joined(option.choices) + "\" ;;\n";
    } else {
      files += (files.empty() ? "" : " | ") + alternatives(option.names);
    }
  }
  if (!files.empty()) cases += "        " + files + ") takes_file=1 ;;\n";
  if (!cases.empty()) text += "      case $previous in\n" + cases + "      esac\n";
  return text + "      ;;\n";
}

std::string zsh_text(const std::string& text) { return escaped(text, "[]:"); }

// What zsh offers for a value.
std::string zsh_action(const Argument& argument) {
  if (is_solver_option(argument)) return "option:_marble_solver_options";
  if (!argument.choices.empty()) return "value:(" + joined(argument.choices) + ")";
  return zsh_text(argument.place) + ":_files";
}

std::string zsh_branch(const Command& command) {
  std::string text = "    " + command.name + ")\n      _arguments";
  for (const Argument& option : command.options) {
    for (const std::string& name : option.names) {
      std::string spec = (option.repeats ? "*" : "") + name + "[" + zsh_text(brief(option.description)) + "]";
      if (option.takes_value) spec += ":" + zsh_action(option);
      text += " \\\n        " + in_quotes(spec, "'\\''");
    }
  }
  for (std::size_t i = 0; i < command.places.size(); ++i) {
    const Argument& place = command.places[i];
    const std::string position = place.repeats ? "*" : std::to_string(i + 1);
    text += " \\\n        " + in_quotes(position + ":" + zsh_action(place), "'\\''");
  }
  return text + "\n      ;;\n";
}

std::string fish_names(const Argument& option) {
  std::string text;
  for (const std::string& name : option.names)
    text += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
  return text;
}

}  // namespace

std::string bash_completion(const std::vector<Command>& commands,
                            const std::vector<std::string>& solver_options) {
  std::vector<std::string> first = names_of(commands.front().options);
  std::string branches;
  for (std::size_t i = 1; i < commands.size(); ++i) {
    first.push_back(commands[i].name);
    branches += bash_branch(commands[i]);
  }
  return "# Completion of marble for bash, made by: marble completion bash\n"
         "_marble() {\n"
         "  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]} command= i\n"
         "  local options= words= values= takes_file=\n"
         "  local solver_options=\"" +
         joined(solver_options, "=") +
         "\"\n"
         "  for ((i = 1; i < COMP_CWORD; i++)); do\n"
         "    [[ ${COMP_WORDS[i]} == -* ]] || { command=${COMP_WORDS[i]}; break; }\n"
         "  done\n"
         "  # Bash splits --output=json into three words.\n"
         "  if [[ $current == = ]]; then current=\n"
         "  elif [[ $previous == = ]]; then previous=${COMP_WORDS[COMP_CWORD-2]}\n"
         "  fi\n"
         "  COMPREPLY=()\n"
         "  case $command in\n"
         "    '') words=\"" +
         joined(first) + "\" options=$words ;;\n" + branches +
         "  esac\n"
         "  if [[ $values ]]; then words=$values\n"
         "  elif [[ $takes_file ]]; then words=\n"
         "  elif [[ $current == -* ]]; then words=$options\n"
         "  fi\n"
         "  if [[ $words ]]; then\n"
         "    mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$current\")\n"
         "    [[ ${COMPREPLY[0]} != *= ]] || compopt -o nospace 2>/dev/null\n"
         "  else\n"
         "    mapfile -t COMPREPLY < <(compgen -f -- \"$current\")\n"
         "    compopt -o filenames 2>/dev/null\n"
         "  fi\n"
         "}\n"
         "complete -F _marble marble\n";
}

std::string zsh_completion(const std::vector<Command>& commands,
                           const std::vector<std::string>& solver_options) {
  std::string names, branches, options;
  for (std::size_t i = 1; i < commands.size(); ++i) {
    names += "    " +
             in_quotes(commands[i].name + ":" + escaped(brief(commands[i].description), ":"), "'\\''") + "\n";
    branches += zsh_branch(commands[i]);
  }
  for (const Argument& option : commands.front().options) {
    for (const std::string& name : option.names)
      options += " " + in_quotes(name + "[" + zsh_text(brief(option.description)) + "]", "'\\''");
  }
  return "#compdef marble\n"
         "# Completion of marble for zsh, made by: marble completion zsh\n"
         "_marble_solver_options() {\n"
         "  compadd -S '' -- " +
         joined(solver_options, "=") +
         "\n}\n"
         "_marble() {\n"
         "  local curcontext=$curcontext state line\n"
         "  local -a commands\n"
         "  commands=(\n" +
         names +
         "  )\n"
         "  _arguments -C" +
         options +
         " '1:command:->command' '*::argument:->argument' && return\n"
         "  case $state in\n"
         "    command) _describe -t commands command commands; return ;;\n"
         "  esac\n"
         "  case $words[1] in\n" +
         branches +
         "  esac\n"
         "}\n"
         "if [[ $funcstack[1] == _marble ]]; then _marble \"$@\"; else compdef _marble marble; fi\n";
}

std::string fish_completion(const std::vector<Command>& commands,
                            const std::vector<std::string>& solver_options) {
  const auto quoted = [](const std::string& text) { return in_quotes(escaped(text, "\\"), "\\'"); };
  const std::string start = "complete -c marble -n ";
  std::string text = "# Completion of marble for fish, made by: marble completion fish\n";
  text += start + "__fish_use_subcommand -f\n";
  for (const Argument& option : commands.front().options)
    text += start + "__fish_use_subcommand" + fish_names(option) + " -d " +
            quoted(brief(option.description)) + "\n";
  for (std::size_t i = 1; i < commands.size(); ++i) {
    const Command& command = commands[i];
    text += start + "__fish_use_subcommand -a " + command.name + " -d " + quoted(brief(command.description)) +
            "\n";
    const std::string within = start + quoted("__fish_seen_subcommand_from " + command.name);
    for (const Argument& option : command.options) {
      text += within + fish_names(option) + " -d " + quoted(brief(option.description));
      if (is_solver_option(option)) {
        text += " -x -a " + quoted(joined(solver_options, "="));
      } else if (!option.choices.empty()) {
        text += " -x -a " + quoted(joined(option.choices));
      } else if (option.takes_value) {
        text += " -r -F";
      }
      text += "\n";
    }
    if (!command.places.empty() && !command.places.front().choices.empty())
      text += within + " -f -a " + quoted(joined(command.places.front().choices)) + "\n";
  }
  return text;
}

}  // namespace marble::cli
