// SPDX-License-Identifier: MIT
// PURPOSE  results that exist, compared, merged and shown for other languages
// METHOD   both texts of a comparison are made at once, so that asking for them cannot fail
#include "guard.hpp"

#include "compare/comparison.hpp"
#include "compare/known_table.hpp"
#include "compare/merge.hpp"
#include "result/result.hpp"
#include "result_handle.hpp"

#include <cstring>
#include <memory>
#include <okid_host/compare.h>
#include <string_view>

struct okid_host_comparison {
    std::string json, table;
};

using namespace okid_host;

int32_t okid_host_compare(const char* before, const char* before_name, const char* after, const char* after_name,
                          okid_host_comparison_t** out) {
    if (out) *out = nullptr;
    return face::guard([&] {
        face::given(out, before, before_name, after, after_name);
        const comparison found =
            compare_results(read_known_result(before, before_name), read_known_result(after, after_name));
        auto made = std::make_unique<okid_host_comparison>();
        made->json = result_text(comparison_json(found));
        made->table = face::argument_words(comparison_table(found));
        *out = made.release();
    });
}

const char* okid_host_comparison_json(const okid_host_comparison_t* self) {
    return self ? self->json.c_str() : nullptr;
}

const char* okid_host_comparison_table(const okid_host_comparison_t* self) {
    return self ? self->table.c_str() : nullptr;
}

void okid_host_comparison_delete(okid_host_comparison_t* self) { delete self; }

int32_t okid_host_merge(const char* const* results, const char* const* names, int32_t count, const char* references,
                        okid_host_result_t** out) {
    if (out) *out = nullptr;
    return face::guard([&] {
        face::given(out);
        face::given_where(count > 0, results, names);
        std::vector<known_result> known;
        for (int32_t i = 0; i < count; ++i) {
            face::given(results[i], names[i]);
            known.push_back(read_known_result(results[i], names[i]));
        }
        std::vector<std::string> wanted;
        for (const char* at = references ? references : ""; *at;) {
            const std::string_view line(at, std::strcspn(at, "\n"));
            wanted.emplace_back(line);
            at += line.size() + (at[line.size()] == '\n' ? 1 : 0);
        }
        *out = face::make_result(merge_results(known, wanted));
    });
}

const char* okid_host_table(const char* result, const char* name) {
    static thread_local std::string text;
    const int code = face::guard([&] {
        face::given(result, name);
        text = face::argument_words(known_table(result, name));
    });
    return code == 0 ? text.c_str() : nullptr;
}
