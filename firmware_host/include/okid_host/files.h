/* SPDX-License-Identifier: MIT */
/**
 * @file files.h
 * @brief Files of a user, read and checked: configurations.
 */
#ifndef OKID_HOST_FILES_H
#define OKID_HOST_FILES_H

#include <okid_host.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A CONFIG.toml, checked whole. */
typedef struct okid_host_config okid_host_config_t;

/**
 * Read and check a CONFIG.toml, with the signal descriptions and presets it names. No device is opened.
 * @param path  of the file; the signal descriptions are looked for beside it
 * @param text  NULL: the file is read; else what stands in it
 * @param out   the configuration, NULL after a failure
 * @return 0, or 2: okid_host_error() names file, line and key, what was found and what was expected
 */
OKID_HOST_API int32_t okid_host_config_load(const char* path, const char* text, okid_host_config_t** out);

/** okid.check/1, as `okid check --json` writes it: every section with its defaults filled in, channels in the order
 * inputs, outputs, others. */
OKID_HOST_API const char* okid_host_config_json(const okid_host_config_t* self);

OKID_HOST_API void okid_host_config_delete(okid_host_config_t* self);

#ifdef __cplusplus
}
#endif

#endif
