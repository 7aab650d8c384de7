/* SPDX-License-Identifier: MIT */
/**
 * @file files.h
 * @brief Files of a user, read and checked: configurations, CSV records; units.
 */
#ifndef OKID_HOST_FILES_H
#define OKID_HOST_FILES_H

/** A CONFIG.toml, checked whole. (Above the rest: whichever of these headers comes first, all of them know it.) */
typedef struct okid_host_config okid_host_config_t;

#include <okid_host.h>

#ifdef __cplusplus
extern "C" {
#endif

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

/** A CSV record. */
typedef struct okid_host_csv okid_host_csv_t;

/**
 * Read all columns of a CSV record that have a name, by the rules of `okid identify`.
 * @return 0, or 2: okid_host_error() names file, line and column, what was found and what was expected
 */
OKID_HOST_API int32_t okid_host_csv_read(const char* path, okid_host_csv_t** out);

/** {"names": [..], "units": [..] ("" = the name has none), "fs_hz": number or null, "comments": the lines above the names,
 * "rate_remark": why the time gives no rate, or ""}. */
OKID_HOST_API const char* okid_host_csv_json(const okid_host_csv_t* self);

/** The samples, row by row, NaN = missing. @param rows, columns  how many */
OKID_HOST_API const double* okid_host_csv_samples(const okid_host_csv_t* self, size_t* rows, size_t* columns);

OKID_HOST_API void okid_host_csv_delete(okid_host_csv_t* self);

/**
 * The unit in the name of a column ("g" of "acc1 [g]", "acc1 (g)" and "acc1_g").
 * @return its length, 0 = none; at most `size` - 1 bytes and a NUL are written to `unit`
 */
OKID_HOST_API size_t okid_host_unit_of_name(const char* name, char* unit, size_t size);

/**
 * What a column probably is, by the unit in its name, else by the name: what `okid identify` proposes.
 * @return "inputs" (a force), "outputs" (a response) or "" (not known)
 */
OKID_HOST_API const char* okid_host_side_of_column(const char* name);

/**
 * What makes a unit SI: 1 unit = factor si.
 * @return 1; 0: the unit is not known
 */
OKID_HOST_API int32_t okid_host_unit(const char* unit, double* factor, const char** si);

#ifdef __cplusplus
}
#endif

#endif
