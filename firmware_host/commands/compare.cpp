// SPDX-License-Identifier: MIT
// PURPOSE  okid compare: two results of one structure, mode by mode
#include "commands.hpp"

#include "compare/comparison.hpp"
#include "error.hpp"
#include "files/whole_file.hpp"
#include "result/result.hpp"

#include <memory>
#include <string>

namespace okid_host {
namespace {

struct compare_arguments {
    std::string before, after, json;
    bool fail_on = false;
};

void compare_files(const compare_arguments& given) {
    if (!given.json.empty()) {
        check_writable(given.json);
        for (const std::string& path : {given.before, given.after}) check_other_file(given.json, path);
    }
    const comparison found = compare_results(load_known_result(given.before), load_known_result(given.after));
    if (!given.json.empty()) write_whole_file(given.json, result_text(comparison_json(found)));
    if (given.json != "-") write_whole_file("-", shown(comparison_table(found)));
    if (given.fail_on && found.changed()) throw failure(exit_changed, "");
}

} // namespace

void add_compare(CLI::App& app) {
    auto given = std::make_shared<compare_arguments>();
    CLI::App* command =
        app.add_subcommand("compare", "Compare two results: which modes moved, and whether that is more than chance");
    command->add_option("a", given->before, "the earlier result")->required()->type_name("A.json");
    command->add_option("b", given->after, "the later result: shifts are B - A")->required()->type_name("B.json");
    command->add_option("--json", given->json, "write okid.comparison/1 to this file, - is stdout")
        ->type_name("FILE.json");
    command->add_flag(
        "--fail-on", given->fail_on,
        "end with exit code 1 when a frequency or damping ratio shifted by more than chance (modes of one "
        "result alone do not count)");
    command->footer("Example:\n  okid compare before.json after.json");
    command->callback([given] { compare_files(*given); });
}

} // namespace okid_host
