/* SPDX-License-Identifier: MIT */
/**
 * @file compare.h
 * @brief Results that exist: the shifts between two of them, several set-ups as one, and the table of one.
 */
#ifndef OKID_HOST_COMPARE_H
#define OKID_HOST_COMPARE_H

#include <okid_host.h>

#ifdef __cplusplus
extern "C" {
#endif

struct okid_host_result; /* okid_host/record.h */

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

/**
 * What `okid merge` does with its files: results of set-ups with outputs in common as one result (PoSER).
 * @param results, names  of each: a text of schema okid.result/1, and its name for messages
 * @param references      names of the outputs that scale the shapes, one a line; "": all that every result has
 * @return 0 and the result, or 2; then `*out` is NULL
 */
OKID_HOST_API int32_t okid_host_merge(const char* const* results, const char* const* names, int32_t count,
                                      const char* references, struct okid_host_result** out);

/**
 * The table for a person, as `okid identify` printed it.
 * @param result, name  a text of schema okid.result/1, and its name for messages
 * @return valid until the next call of this thread; NULL: okid_host_error() names the key
 */
OKID_HOST_API const char* okid_host_table(const char* result, const char* name);

#ifdef __cplusplus
}
#endif

#endif
