// SPDX-License-Identifier: MIT
// okid: one binary, sub-commands. Parses the command line, runs one command, turns a failure into a message.
#include "commands/commands.hpp"
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "files/whole_file.hpp"

#include <csignal>
#include <cstdio>
#include <exception>
#include <okid/types.h>
#include <string>
#include <unistd.h>
#include <vector>

namespace {

/// A batch command that is interrupted leaves nothing half-written; run and replay put their own handler in place.
void on_interrupt(int) {
    okid_host::remove_unfinished_file();
    constexpr char text[] = "okid: interrupted; no file is left half-written\n";
    (void)!write(STDERR_FILENO, text, sizeof text - 1);
    _exit(okid_host::exit_interrupted);
}

/// An empty value is a variable of a script that was not set: no file, no number and no list of names.
void refuse_empty_values(CLI::App& app) {
    for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; }))
        for (CLI::Option* option : command->get_options())
            if (option->get_items_expected_max() > 0)
                option->check([](const std::string& value) {
                    return value.empty()
                               ? std::string("found an empty value, expected one; leave the option out for its default")
                               : std::string();
                });
}

std::vector<std::string> names_of(const CLI::App& app) {
    std::vector<std::string> out;
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
        out.push_back(command->get_name());
    return out;
}

/// What was wrong with the command line, which command it was and an example of it.
int explain(CLI::App& app, const CLI::ParseError& error, int argc, char** argv) {
    using namespace okid_host;
    const auto parsed = app.get_subcommands();
    if (parsed.empty()) {
        if (argc < 2) return std::fputs(app.help().c_str(), stderr), exit_usage;
        const std::string word = argv[1], known = list_names(names_of(app));
        if (word.front() == '-')
            say("okid: {}; expected a command first: {}\n", error.what(), known);
        else
            say("okid: no command \"{}\"{}; the commands are: {}\n", printable(word), did_you_mean(word, names_of(app)),
                known);
        return exit_usage;
    }
    CLI::App& command = *parsed.front();
    std::string text = error.what(), near;
    for (const CLI::Option* option : command.get_options())
        if (option->get_positional() && text.rfind(option->get_name() + " is required", 0) == 0)
            text = option->get_type_name() + " is missing: " + option->get_description();
    if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
        std::vector<std::string> options;
        for (const CLI::Option* option : command.get_options())
            for (const std::string& name : option->get_lnames()) options.push_back("--" + name);
        const auto extra = app.remaining(true);
        if (!extra.empty()) near = did_you_mean(extra.front(), options);
    }
    say("okid {}: {}{}\n{}\nAll options: okid {} --help\n", command.get_name(), text, near, command.get_footer(),
        command.get_name());
    return exit_usage;
}

} // namespace

int main(int argc, char** argv) {
    std::signal(SIGINT, on_interrupt);
    std::signal(SIGTERM, on_interrupt);
    if (std::signal(SIGHUP, on_interrupt) == SIG_IGN) std::signal(SIGHUP, SIG_IGN); // nohup
    std::signal(SIGXFSZ, SIG_IGN); // a file beyond the limit of its size is a write that fails, with a message
    CLI::App app{"okid: from a cable of sensor frames to natural frequencies, damping ratios and mode shapes", "okid"};
    app.set_version_flag("--version",
                         std::string("okid ") + okid_version() + " (" + okid_backend() + ")" + okid_host::left_out());
    app.require_subcommand(1);
    app.get_formatter()->label("REQUIRED", ""); // the usage line puts brackets around what is not
    app.footer("okid COMMAND --help lists the options of a command.\n\n"
               "Example:\n  okid identify frame.csv --inputs force --outputs acc1,acc2,acc3");
    okid_host::add_identify(app);
    okid_host::add_compare(app);
    okid_host::add_merge(app);
    okid_host::add_run(app);
    okid_host::add_record(app);
    okid_host::add_replay(app);
    okid_host::add_simulate(app);
    okid_host::add_convert(app);
    okid_host::add_init(app);
    okid_host::add_check(app);
    okid_host::add_doctor(app);
#ifndef OKID_PORTABLE
    okid_host::add_bench(app);
#endif
    okid_host::add_support_bundle(app);
    okid_host::add_completion(app);
    refuse_empty_values(app);
    static char help[] = "--help", version[] = "--version";
    const std::string word = argc >= 2 ? argv[1] : "";
    if (word == "help" && argc >= 3) { // okid help COMMAND is okid COMMAND --help
        argv[1] = argv[2];
        argv[2] = help;
        argc = 3;
    } else if (word == "help" || word == "version" || word == "-v" || word == "-V") {
        argv[1] = word == "help" ? help : version;
    }
    try {
        app.parse(argc, argv);
        return okid_host::exit_ok;
    } catch (const CLI::ParseError& error) {
        return error.get_exit_code() == 0 ? app.exit(error) : explain(app, error, argc, argv);
    } catch (const okid_host::failure& error) {
        if (*error.what()) okid_host::say("okid: {}\n", okid_host::one_line(error.what()));
        return error.code;
    } catch (const std::bad_alloc&) {
        std::fprintf(stderr, "okid: out of memory\n");
        return okid_host::exit_device;
    } catch (const std::exception& error) {
        okid_host::say("okid: internal error: {}\n", error.what());
        return okid_host::exit_device;
    }
}
