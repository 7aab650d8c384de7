// SPDX-License-Identifier: MIT
// okid completion: the command line as a shell has to know it, read out of the command line itself.
#include "completion.hpp"

#include "commands.hpp"
#include "files/whole_file.hpp"

#include <algorithm>
#include <cctype>

namespace okid_host {
namespace {

/// The first clause of a help text, parentheses left whole: what fits beside a candidate.
std::string first_clause(const std::string& text) {
    int depth = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
        depth += text[i] == '(' ? 1 : text[i] == ')' ? -1 : 0;
        if (depth == 0 && (text.compare(i, 2, "; ") == 0 || text.compare(i, 2, ". ") == 0)) return text.substr(0, i);
    }
    return text;
}

bool in_capitals(const std::string& text) {
    return !text.empty() && std::all_of(text.begin(), text.end(),
                                        [](unsigned char c) { return std::isupper(c) != 0 || c == '_' || c == '-'; });
}

void read_alternative(const std::string& text, completion_values& out) {
    const std::size_t dot = text.find('.');
    if (dot != std::string::npos && in_capitals(text.substr(0, dot)))
        out.endings.push_back(text.substr(dot + 1));
    else if (text == "FILE")
        out.any_file = true;
    else if (text == "FOLDER")
        out.folder = true;
    else if (text == "INTERFACE")
        out.interface = true;
    else if (text == "DEVICE")
        out.device = true;
    else if (!text.empty() && std::islower(static_cast<unsigned char>(text.front())) != 0)
        out.words.push_back(text);
}

completion_option read_option(const CLI::Option& option) {
    completion_option out;
    for (const std::string& name : option.get_lnames()) out.names.push_back("--" + name);
    for (const std::string& name : option.get_snames()) out.names.push_back("-" + name);
    out.meaning = first_clause(option.get_description());
    out.label = option.get_type_name();
    out.takes_value = option.get_items_expected_max() > 0;
    if (out.takes_value) out.values = read_values(out.label);
    return out;
}

struct completion_arguments {
    std::string shell;
};

void print_script(const completion_arguments& given, const CLI::App& program) {
    const completion_command tree = read_command(program);
    write_whole_file("-", given.shell == "bash"  ? bash_completion(tree)
                          : given.shell == "zsh" ? zsh_completion(tree)
                                                 : fish_completion(tree));
}

} // namespace

completion_values read_values(const std::string& type_name) {
    completion_values out;
    for (std::size_t at = 0; at <= type_name.size();) {
        const std::size_t bar = std::min(type_name.find('|', at), type_name.size());
        read_alternative(type_name.substr(at, bar - at), out);
        at = bar + 1;
    }
    return out;
}

completion_command read_command(const CLI::App& app) {
    completion_command out;
    out.name = app.get_name();
    out.meaning = first_clause(app.get_description());
    for (const CLI::Option* option : app.get_options()) {
        if (option->get_positional())
            out.places.push_back({option->get_type_name(),
                                  option->get_expected_max() >= CLI::detail::expected_max_vector_size,
                                  read_values(option->get_type_name())});
        else
            out.options.push_back(read_option(*option));
    }
    for (const CLI::App* command : app.get_subcommands(nullptr)) out.commands.push_back(read_command(*command));
    return out;
}

std::string join(const std::vector<std::string>& words, const std::string& between, const std::string& quote) {
    std::string out;
    for (const std::string& word : words) out += (out.empty() ? "" : between) + quote + word + quote;
    return out;
}

void add_completion(CLI::App& app) {
    auto given = std::make_shared<completion_arguments>();
    CLI::App* command = app.add_subcommand("completion", "Print the completion script of a shell");
    command->add_option("shell", given->shell, "the shell that loads it")
        ->required()
        ->type_name("bash|zsh|fish")
        ->check(CLI::IsMember({"bash", "zsh", "fish"}).description(""));
    command->footer("The Debian package installs all three. To load one by hand, for this session:\n"
                    "  bash: source <(okid completion bash)\n"
                    "  zsh:  source <(okid completion zsh)      (after compinit)\n"
                    "  fish: okid completion fish | source\n"
                    "To keep it, write its output to\n"
                    "  bash: ~/.local/share/bash-completion/completions/okid      (needs the package bash-completion)\n"
                    "  zsh:  a file _okid in a folder of $fpath\n"
                    "  fish: ~/.config/fish/completions/okid.fish\n\n"
                    "Example:\n  okid completion bash > ~/.local/share/bash-completion/completions/okid");
    command->callback([given, &app] { print_script(*given, app); });
}

} // namespace okid_host
