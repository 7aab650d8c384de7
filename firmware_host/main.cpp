// SPDX-License-Identifier: MIT
// okid: one binary, sub-commands. Parses the command line, runs one command, turns a failure into a message.
#include "commands/commands.hpp"
#include "error.hpp"
#include "whole_file.hpp"

#include <csignal>
#include <cstdio>
#include <exception>
#include <okid/types.h>
#include <unistd.h>

namespace {

/// A batch command that is interrupted leaves nothing half-written; run and replay put their own handler in place.
void on_interrupt(int) {
    okid_host::remove_unfinished_file();
    _exit(okid_host::exit_interrupted);
}

} // namespace

int main(int argc, char** argv) {
    std::signal(SIGINT, on_interrupt);
    std::signal(SIGTERM, on_interrupt);
    CLI::App app{"okid: from a cable of sensor frames to natural frequencies, damping ratios and mode shapes", "okid"};
    app.set_version_flag("--version", std::string("okid ") + okid_version() + " (" + okid_backend() + ")");
    app.require_subcommand(1);
    okid_host::add_identify(app);
    okid_host::add_run(app);
    okid_host::add_record(app);
    okid_host::add_replay(app);
    okid_host::add_simulate(app);
    okid_host::add_convert(app);
    okid_host::add_check(app);
    okid_host::add_doctor(app);
    okid_host::add_bench(app);
    try {
        app.parse(argc, argv);
        return okid_host::exit_ok;
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? okid_host::exit_ok : okid_host::exit_usage;
    } catch (const okid_host::failure& error) {
        if (*error.what()) std::fprintf(stderr, "okid: %s\n", error.what());
        return error.code;
    } catch (const std::bad_alloc&) {
        std::fprintf(stderr, "okid: out of memory\n");
        return okid_host::exit_device;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "okid: internal error: %s\n", error.what());
        return okid_host::exit_device;
    }
}
