// SPDX-License-Identifier: MIT
// PURPOSE    the lagged sums of 16-bit codes by FFT: the same integers as the direct kernel, for long lags and long calls; of doubles
//            to a few eps of the energy
#ifndef OKID_SPECTRUM_H
#define OKID_SPECTRUM_H

#include <stddef.h>
#include <stdint.h>

enum { SPECTRUM_LANES = 8, SPECTRUM_BATCH = 4, SPECTRUM_GROUPS = 32 };

/// Sizes for m channels and p lags.
typedef struct spectrum_plan_t {
    int32_t m, p;
    int32_t length; ///< N, samples of a window, a power of two
    int32_t share;  ///< windows side by side in the lanes: 2 of up to half as many channels
    int32_t groups; ///< of SPECTRUM_LANES channels
    int32_t turns;  ///< cross-spectra of a lane vector each
} spectrum_plan_t;

/// The most that one call of the absorb function takes.
static inline int32_t spectrum_samples(const spectrum_plan_t* plan) { return SPECTRUM_BATCH * plan->length; }

spectrum_plan_t okid_spectrum_plan(int32_t m, int32_t p);

/// Is it faster than the direct kernel? A constant rule, so that a replay takes the same path; the sums are equal anyhow.
int okid_spectrum_pays(int32_t m, int32_t p);

/// Doubles of memory, and the one-time filling of its tables. The rest must be zero at the start.
size_t okid_spectrum_doubles(const spectrum_plan_t* plan);
void okid_spectrum_create(const spectrum_plan_t* plan, double* memory);

/// Sums gathered since the last flush are exact after rounding while this stays below 1/2.
double okid_spectrum_error(const spectrum_plan_t* plan, double energy);

/// Of some codes the largest sum of squares of a channel, for okid_spectrum_error().
double okid_spectrum_energy(int32_t m, const int16_t* codes, int32_t count);

/// Absorb `count` samples, up to spectrum_samples(), codes or numbers (the other one NULL), that follow the p samples of
/// `history` (time order, m numbers each).
typedef void okid_spectrum_absorb_fn(const spectrum_plan_t* plan, double* memory, const double* history,
                                     const int16_t* codes, const double* numbers, int32_t count);

/// Bring out the sums S (m x m(p+1), row-major, as the direct kernel has them), start over: of codes written as exact
/// integers, else added to what stands there.
typedef void okid_spectrum_flush_fn(const spectrum_plan_t* plan, double* memory, double* sums, int of_codes);

/// Forward transform (exp(-i)) of `total` points, a power of two, each SPECTRUM_LANES numbers and their imaginary parts, in
/// `work`; `spare` is as large. @return the one of both that the result is in
typedef double* okid_spectrum_transform_fn(const double* cosine, const double* sine, double* work, double* spare,
                                           int total);
/// The tables of a transform, `total` numbers each.
void okid_spectrum_tables(int total, double* cosine, double* sine);

typedef struct spectrum_kernels_t {
    okid_spectrum_absorb_fn* absorb;
    okid_spectrum_flush_fn* flush;
    okid_spectrum_transform_fn* transform;
} spectrum_kernels_t;

/// The fastest this processor runs.
spectrum_kernels_t okid_spectrum_pick(void);

#endif
