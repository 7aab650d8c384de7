// SPDX-License-Identifier: MIT
// PURPOSE  results that exist, compared for other languages
// METHOD   both texts are made at once, so that asking for them cannot fail
#include "guard.hpp"

#include "compare/comparison.hpp"
#include "result/result.hpp"

#include <memory>
#include <okid_host/compare.h>

struct okid_host_comparison {
    std::string json, table;
};

using namespace okid_host;

int32_t okid_host_compare(const char* before, const char* before_name, const char* after, const char* after_name,
                          okid_host_comparison_t** out) {
    *out = nullptr;
    return face::guard([&] {
        const comparison found =
            compare_results(read_known_result(before, before_name), read_known_result(after, after_name));
        auto made = std::make_unique<okid_host_comparison>();
        made->json = result_text(comparison_json(found));
        made->table = face::argument_words(comparison_table(found));
        *out = made.release();
    });
}

const char* okid_host_comparison_json(const okid_host_comparison_t* self) { return self->json.c_str(); }

const char* okid_host_comparison_table(const okid_host_comparison_t* self) { return self->table.c_str(); }

void okid_host_comparison_delete(okid_host_comparison_t* self) { delete self; }
