/* SPDX-License-Identifier: MIT */
/**
 * @file compare.h
 * @brief Results that exist: which modes moved between two of them, and whether that is more than chance.
 */
#ifndef OKID_HOST_COMPARE_H
#define OKID_HOST_COMPARE_H

#include <okid_host.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Two results, compared. */
typedef struct okid_host_comparison okid_host_comparison_t;

/**
 * What `okid compare` does with its files. Shifts are `after` minus `before`.
 * @param before, after            texts of schema okid.result/1
 * @param before_name, after_name  for messages and the table
 * @param out                      the comparison, NULL after a failure
 * @return 0, or 2: okid_host_error() names the text, the key, what was found and what was expected
 */
OKID_HOST_API int32_t okid_host_compare(const char* before, const char* before_name, const char* after,
                                        const char* after_name, okid_host_comparison_t** out);

/** okid.comparison/1, as `okid compare --json` writes it. */
OKID_HOST_API const char* okid_host_comparison_json(const okid_host_comparison_t* self);

/** The table for a person, as `okid compare` prints it. */
OKID_HOST_API const char* okid_host_comparison_table(const okid_host_comparison_t* self);

OKID_HOST_API void okid_host_comparison_delete(okid_host_comparison_t* self);

#ifdef __cplusplus
}
#endif

#endif
