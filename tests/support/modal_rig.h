// SPDX-License-Identifier: MIT
// A discrete system with known modes for the tests of the library: block-diagonal rotations, fixed B, C, D, and a small
// reproducible random generator. Truth by construction, nothing is identified here.
#ifndef OKID_TEST_MODAL_RIG_H
#define OKID_TEST_MODAL_RIG_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { RIG_MODES = 3, RIG_NZ = 6, RIG_NU = 1, RIG_NY = 3, RIG_M = 4 };
#define RIG_FS 200.0
static const double rig_frequency[RIG_MODES] = {8.0, 23.0, 41.0};
static const double rig_damping[RIG_MODES] = {0.010, 0.008, 0.012};

typedef struct rig_t {
    double A[RIG_NZ * RIG_NZ], B[RIG_NZ * RIG_NU], C[RIG_NY * RIG_NZ], D[RIG_NY * RIG_NU];
} rig_t;

static inline double rig_uniform(uint64_t* state) {
    *state = *state * 6364136223846793005ULL + 1442695040888963407ULL;
    return (double)(*state >> 11) / 9007199254740992.0;
}

static inline double rig_normal(uint64_t* state) {
    const double radius = sqrt(-2 * log(1 - rig_uniform(state))), angle = 6.283185307179586 * rig_uniform(state);
    return radius * cos(angle);
}

static inline void rig_make(rig_t* rig) {
    memset(rig, 0, sizeof *rig);
    for (int k = 0; k < RIG_MODES; ++k) {
        const double omega = 6.283185307179586 * rig_frequency[k], zeta = rig_damping[k];
        const double radius = exp(-zeta * omega / RIG_FS), angle = omega * sqrt(1 - zeta * zeta) / RIG_FS;
        const int i = 2 * k;
        rig->A[i * RIG_NZ + i] = rig->A[(i + 1) * RIG_NZ + i + 1] = radius * cos(angle);
        rig->A[i * RIG_NZ + i + 1] = radius * sin(angle);
        rig->A[(i + 1) * RIG_NZ + i] = -radius * sin(angle);
        rig->B[i] = 0.3 + 0.2 * k;
        rig->B[i + 1] = 0.5 - 0.3 * k;
        for (int o = 0; o < RIG_NY; ++o) {
            rig->C[i * RIG_NY + o] = 1.0 + 0.7 * sin(1.0 + o + 2.1 * k);
            rig->C[(i + 1) * RIG_NY + o] = 0.4 * cos(0.5 * o - k);
        }
    }
    for (int o = 0; o < RIG_NY; ++o) rig->D[o] = 0.1 * (o + 1);
}

/// v = [u; y], RIG_M x count, white force, outputs with white noise of `noise` times their rms of about 3.
static inline double* rig_record(const rig_t* rig, int count, double noise, const double* x0, uint64_t seed) {
    double* v = malloc(sizeof *v * (size_t)count * RIG_M);
    double x[RIG_NZ] = {0}, next[RIG_NZ];
    if (x0) memcpy(x, x0, sizeof x);
    uint64_t state = seed * 2654435761u + 12345;
    for (int n = 0; n < count; ++n) {
        const double u = rig_normal(&state);
        double* sample = v + (size_t)n * RIG_M;
        sample[0] = u;
        for (int o = 0; o < RIG_NY; ++o) {
            double y = rig->D[o] * u;
            for (int j = 0; j < RIG_NZ; ++j) y += rig->C[j * RIG_NY + o] * x[j];
            sample[1 + o] = y + noise * 3 * rig_normal(&state);
        }
        for (int i = 0; i < RIG_NZ; ++i) {
            next[i] = rig->B[i] * u;
            for (int j = 0; j < RIG_NZ; ++j) next[i] += rig->A[j * RIG_NZ + i] * x[j];
        }
        memcpy(x, next, sizeof x);
    }
    return v;
}

/// The same record behind a steep low-pass filter (0.7 Nyquist) that the force does not see, with a little noise: plain
/// least squares gives an unstable ARX model (trap 22).
static inline double* rig_filtered(const double* v, int count) {
    enum { HALF = 24 };
    double* filtered = calloc((size_t)count * RIG_M, sizeof *filtered);
    uint64_t state = 4;
    for (int n = 0; n < count; ++n) {
        filtered[n * RIG_M] = v[n * RIG_M];
        for (int c = 1; c < RIG_M; ++c) {
            double sum = 1e-3 * rig_normal(&state);
            for (int k = -HALF; k <= HALF; ++k) {
                if (n + k < 0 || n + k >= count) continue;
                const double x = 3.14159265358979 * 0.7 * k, sinc = k ? sin(x) / x : 1;
                sum += 0.7 * sinc * (0.54 + 0.46 * cos(3.14159265358979 * k / HALF)) * v[(n + k) * RIG_M + c];
            }
            filtered[n * RIG_M + c] = sum;
        }
    }
    return filtered;
}

/// True Markov parameter Y_k of the rig (RIG_NY numbers).
static inline void rig_markov(const rig_t* rig, int k, double* out) {
    if (k == 0) {
        memcpy(out, rig->D, sizeof rig->D);
        return;
    }
    double x[RIG_NZ], next[RIG_NZ];
    memcpy(x, rig->B, sizeof x);
    for (int step = 1; step < k; ++step) {
        for (int i = 0; i < RIG_NZ; ++i) {
            next[i] = 0;
            for (int j = 0; j < RIG_NZ; ++j) next[i] += rig->A[j * RIG_NZ + i] * x[j];
        }
        memcpy(x, next, sizeof x);
    }
    for (int o = 0; o < RIG_NY; ++o) {
        out[o] = 0;
        for (int j = 0; j < RIG_NZ; ++j) out[o] += rig->C[j * RIG_NY + o] * x[j];
    }
}

#endif
