// SPDX-License-Identifier: MIT
// PURPOSE  okid merge: results of set-ups of one structure as one result
#include "compare/merge.hpp"

#include "commands.hpp"
#include "error.hpp"
#include "files/whole_file.hpp"
#include "record/csv_header.hpp"
#include "result/result.hpp"

#include <memory>
#include <string>
#include <vector>

namespace okid_host {
namespace {

struct merge_arguments {
    std::vector<std::string> results;
    std::string references, json;
};

void merge_files(const merge_arguments& given) {
    if (!given.json.empty()) {
        check_writable(given.json);
        for (const std::string& path : given.results) check_other_file(given.json, path);
    }
    std::vector<known_result> known;
    for (const std::string& path : given.results) known.push_back(load_known_result(path));
    const record_result merged = merge_results(
        known, given.references.empty() ? std::vector<std::string>() : split_names("--references", given.references));
    const okid_identified_t& model = merged.model.view();
    if (!given.json.empty()) write_whole_file(given.json, result_text(result_json(model, merged.context)));
    if (given.json != "-") write_whole_file("-", shown(result_table(model, merged.context)));
}

} // namespace

void add_merge(CLI::App& app) {
    auto given = std::make_shared<merge_arguments>();
    CLI::App* command = app.add_subcommand(
        "merge", "Merge results of set-ups of one structure, with sensors in common, into one result (PoSER)");
    command->add_option("results", given->results, "results with outputs in common, one a set-up")
        ->required()
        ->type_name("RESULT.json");
    command
        ->add_option("--references", given->references,
                     "the outputs that scale the shapes (default: all that every result has)")
        ->type_name("NAMES");
    command->add_option("--json", given->json, "write okid.result/1 to this file, - is stdout")->type_name("FILE.json");
    command->footer("Example:\n  okid merge span1.json span2.json span3.json --json bridge.json");
    command->callback([given] { merge_files(*given); });
}

} // namespace okid_host
