// SPDX-License-Identifier: MIT
/// @file change.h
/// Has a structure changed since a baseline? A test that identifies nothing: the column space of the baseline's observability
/// matrix is compared with the sums of new samples. What it yields is one probability, and beside it how far each mode of
/// the baseline has moved and with which standard deviation. Level and colour of the excitation may be others than in the
/// baseline; forces that are measured are taken out as inputs, others have to be broad-band as in any ambient test.
///
/// Samples come as sums of blocks (okid/accumulator.h, lags >= 2 rows - 1): stretches of a record, slots of a window, parts
/// of a campaign. Blocks are compared with one another for the covariance, so that they should be long beside the decay
/// of the modes and about equally long.
#ifndef OKID_CHANGE_H
#define OKID_CHANGE_H

#include <okid/accumulator.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Sizes and the rate of false alarms.
typedef struct okid_change_config_t {
    int32_t n_u;    ///< inputs, 0..256; 0 = output-only
    int32_t n_y;    ///< outputs, 1..256
    int32_t rows;   ///< i, block rows of past and of future, 2..512; 2 i (n_u + n_y) <= 8192
    int32_t order;  ///< states of the baseline, even, at most (i-1) n_y; 0 = as many as the baseline shows. Too many
                    ///< do no harm, too few are taken for a change when the excitation changes
    int32_t blocks; ///< most blocks of a baseline or a test, 1..1024; 0 = 20
    double false_alarm; ///< probability of an alarm in a test of a structure that did not change, 0 < x < 1; 0 = 0.001
    double fs_hz;       ///< sample rate, Hz
} okid_change_config_t;

/// Twenty blocks, one false alarm in a thousand tests.
static inline okid_change_config_t okid_change_defaults(int32_t n_u, int32_t n_y, int32_t rows, double fs_hz) {
    const okid_change_config_t config = {n_u, n_y, rows, 0, 20, 0.001, fs_hz};
    return config;
}

/// A mode of the baseline in the newest test.
typedef struct okid_change_mode_t {
    double frequency_hz;  ///< of the baseline
    double damping_ratio; ///< of the baseline
    double shift;         ///< relative change of the frequency, linearised
    double sigma;         ///< standard deviation of the shift, both errors included; NaN with fewer than four blocks
} okid_change_mode_t;

/// What a test found.
typedef struct okid_change_verdict_t {
    double statistic; ///< chi-square in the limit of many blocks: s' (C + C_0)^-1 s of the shifts s
    double p_value;   ///< probability of so much without a change (F distribution); NaN with fewer than four blocks
    double freedom;   ///< of the covariance estimated from the blocks
    int32_t modes;    ///< tested
    int32_t farthest; ///< the mode with the largest |shift| / sigma
    int32_t blocks;   ///< tested
    int32_t alarm;    ///< 1: p_value < false_alarm
} okid_change_verdict_t;

/// Private; lives in the caller's block.
typedef struct okid_change okid_change_t;

/// Bytes okid_change_create() needs; 0 when the configuration is invalid. (blocks + 2) (2 i m)^2 doubles and some.
OKID_API size_t okid_change_memsize(const okid_change_config_t* config);
/// Lay one without a baseline out in the caller's block. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM, OKID_ERR_MEMORY
OKID_NODISCARD OKID_API okid_status_t okid_change_create(okid_change_t** self, const okid_change_config_t* config,
                                                         void* block, size_t bytes);

/// The sums of one more block, less its means; they stay as they are. Cost O((lags m)^2).
/// @param scratch  (m (lags + 1))^2 doubles
/// @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH (inputs, outputs, too few lags), OKID_ERR_DIM (more than `blocks`),
///         OKID_ERR_TOO_SHORT (no rows)
OKID_NODISCARD OKID_API okid_status_t okid_change_add(okid_change_t* self, okid_accumulator_t* sums, double* scratch);

/// The blocks added since the last call of learn, test or clear become the baseline. Its modes are those with a damping
/// ratio below 0.2 whose frequency it knows to 2 % (one sigma), at most a third of the blocks: the ones it knows best.
/// @return OKID_OK, OKID_ERR_TOO_SHORT (fewer rows than twice the unknowns), OKID_ERR_OUTPUT (a channel without motion),
///         OKID_ERR_EXCITATION, OKID_ERR_NO_MODES, OKID_ERR_NUMERIC; there is no baseline then. Cost some 10 (i m)^3 flop
OKID_NODISCARD OKID_API okid_status_t okid_change_learn(okid_change_t* self);

/// Test the blocks added since the last call of learn, test or clear, and forget them.
/// @param out  out. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_MISMATCH (no baseline), OKID_ERR_TOO_SHORT, OKID_ERR_EXCITATION,
///         OKID_ERR_NUMERIC. Cost (2 i m)^2 per block and mode, (i m)^3 once
OKID_NODISCARD OKID_API okid_status_t okid_change_test(okid_change_t* self, okid_change_verdict_t* out);

/// Forget the blocks added since; the baseline stays.
OKID_API void okid_change_clear(okid_change_t* self);
/// Blocks added since the last call of learn, test or clear.
OKID_API int32_t okid_change_blocks(const okid_change_t* self);
/// States of the baseline; 0 = there is none.
OKID_API int32_t okid_change_order(const okid_change_t* self);
/// The k-th mode of the newest test, ascending in frequency. @return OKID_OK, OKID_ERR_NULL, OKID_ERR_DIM (there is none)
OKID_NODISCARD OKID_API okid_status_t okid_change_mode(const okid_change_t* self, int32_t k, okid_change_mode_t* out);

#ifdef __cplusplus
}
#endif
#endif
